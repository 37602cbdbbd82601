"""The robot's bench: chip, body, world and lidar on one simulated clock."""

import math
import time
from collections import deque
from dataclasses import replace
from pathlib import Path

import numpy as np

from thumper.board.firmware_image import firmware_image
from thumper.board.messages import Board as BoardKind
from thumper.common.errors import EXIT_CHECK_FAILED, EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.bench.collision import HULL_M, ContactWatch
from thumper_hil.bench.options import BenchOptions
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.chip_faults import FaultyChip
from thumper_hil.chip.instrumented_chip import ATMEGABOOT
from thumper_hil.chip.robot_params import RobotParams
from thumper_hil.faults.catalogue import FaultError, FaultValue, action_of
from thumper_hil.faults.scenario import load_scenario
from thumper_hil.faults.switches import Switches
from thumper_hil.lidars.ld19 import Ld19
from thumper_hil.lidars.urg04lx import Urg04Lx
from thumper_hil.world.scene import Scene
from thumper_hil.world.start_pose import why_not_here
from thumper_hil.world.world import World
from thumper_hil.world.world_history import WorldHistory

ELF_OF_BOARD = {kind: firmware_image(kind.name.lower(), "elf") for kind in BoardKind}
DEFAULT_ELF = ELF_OF_BOARD[BoardKind.TREX]
BASE_FROM_LASER = Pose2(x_m=0.12)
TICK_S = 0.01
"""Ground truth is recorded, and contacts are found, this often."""

TICK_CYCLES = round(TICK_S * CPU_HZ)
LIDAR_LOOK_S = 0.001
REMEMBERED_TRUTHS = 720_000  # two hours; a robot at service for days must not fill the memory
REMEMBERED_POSES = 256  # a sweep of the lidar lasts 75 ms, and a busy reader looks each millisecond
TRUTH_COLUMNS = ("time_s", "x_m", "y_m", "theta_rad", "left_rad_s", "right_rad_s")


def cycle_at(time_s: float) -> int:
    """The first cycle whose time is not before `time_s`: who waits until then must not wait for ever."""
    cycle = math.ceil(time_s * CPU_HZ)
    return cycle if cycle / CPU_HZ >= time_s else cycle + 1  # the product above was rounded down


def _bootloader() -> Path:
    if not ATMEGABOOT.exists():
        raise ThumperError(
            f"reset_on_open: there is no boot loader at {ATMEGABOOT}; sudo apt install arduino-core-avr",
            exit_code=EXIT_CHECK_FAILED,
        )
    return ATMEGABOOT


class Bench:
    """A simulated robot at work. Time passes only in `advance...`; the same seed and bytes give the same run.

    Raises
    ------
    ThumperError
        Firmware or chip library are not built, there is no such world, or the robot would stand in a wall.
    """

    def __init__(self, options: BenchOptions, *, elf: Path | None = None) -> None:
        self._scene = Scene(World.load(options.world))
        if reason := why_not_here(self.world, options.start, HULL_M):
            raise ThumperError(
                f"a robot at x_m={options.x_m:g}, y_m={options.y_m:g}, yaw_deg={options.yaw_deg:g} {reason} "
                f"of {options.world}; start it somewhere free",
                exit_code=EXIT_USAGE,
            )
        params = RobotParams.load()
        if options.charge is not None:
            params = replace(params, battery=replace(params.battery, state_of_charge=options.charge))
        self.chip = FaultyChip(
            elf or ELF_OF_BOARD[options.board], params=params, board=options.board, seed=options.seed
        )
        self._reset_on_open = options.reset_on_open
        if options.reset_on_open:
            self.chip.add_bootloader(_bootloader())
        self.chip.place(options.start)
        self._switches = Switches(chip=self.chip)
        self._events = deque(load_scenario(Path(options.scenario)) if options.scenario else ())
        self._contact = ContactWatch(self.chip, self.world)
        self._truth: deque[tuple[float, ...]] = deque(maxlen=REMEMBERED_TRUTHS)
        self._poses: deque[tuple[float, ...]] = deque(maxlen=REMEMBERED_POSES)
        self._ticks = 0
        self._pillars: list[tuple[float, float, float]] = []
        self._remember()
        self._seen = WorldHistory(self.world)
        lidar = Ld19 if options.lidar == "ld19" else Urg04Lx
        self._lidar: Ld19 | Urg04Lx = lidar(
            world=self._seen, pose_at=self._pose_at, base_from_laser=BASE_FROM_LASER, seed=options.seed
        )
        self._lidar_bytes = bytearray()
        self._wall_start_s = time.monotonic() if options.realtime else None

    @property
    def time_s(self) -> float:
        """Simulated seconds since power-on."""
        return self.chip.time_s

    @property
    def world(self) -> World:
        """What surrounds the robot now."""
        return self._scene.world

    @property
    def contacts(self) -> int:
        """How often the robot has newly driven its hull into something or somebody."""
        return self._contact.count

    @property
    def bumps(self) -> int:
        """How often a person has walked into the robot."""
        return self._scene.bumps

    def truth(self) -> FloatArray:
        """Return the ground truth at 100 Hz, of two hours at most, shape (n, 6): columns `TRUTH_COLUMNS`.

        The pose is in the world's frame, the heading in [-pi, pi]; the wheel speeds are the wheels' own,
        positive forward.
        """
        return np.array(self._truth).reshape(-1, len(TRUTH_COLUMNS))

    def forget_truth(self) -> None:
        """Begin the ground truth anew: hours of it would fill the memory."""
        self._truth.clear()

    def advance(self, until_s: float, *, board_bytes: int = 0) -> None:
        """Let time pass until `until_s`, or until the board has sent so many bytes that are not fetched yet.

        Raises
        ------
        ChipError
            The firmware has crashed.
        """
        until_cycle = cycle_at(until_s)
        arrived = False
        while True:
            self._break_what_is_due()
            # While the host's computer hangs, time passes and nobody looks at what arrives.
            awake_cycle = math.ceil(self._switches.host_hangs_until_s * CPU_HZ)
            hangs = self.chip.cycle < awake_cycle
            end_cycle = max(until_cycle, awake_cycle)
            if self.chip.cycle >= end_cycle or (arrived and not hangs):
                break
            tick_cycle = (self._ticks + 1) * TICK_CYCLES
            fault_cycle = math.ceil(self._events[0].time_s * CPU_HZ) if self._events else end_cycle
            arrived = self.chip.run(
                min(end_cycle, tick_cycle, fault_cycle), bytes_wanted=0 if hangs else board_bytes
            )
            if self.chip.cycle >= tick_cycle:
                self._tick()
        self._pace()

    def fault(self, name: str, value: FaultValue) -> None:
        """Break something now, or mend it: `bench.fault("encoder.left.b", "cut")`; docs/bench.md lists all.

        Raises
        ------
        ThumperError
            No such fault, or a value that it cannot have.
        """
        try:
            action_of(name, value)(self._switches)
        except FaultError as error:
            raise ThumperError(str(error), exit_code=EXIT_USAGE) from error

    @property
    def pillars(self) -> int:
        """How many posts were put up by `put_pillar`."""
        return len(self._pillars)

    def put_pillar(self, base_from_pillar: Pose2, radius_m: float) -> Pose2:
        """Put up a post, from now on, as seen from the robot; returns where it stands in the world.

        Raises
        ------
        ThumperError
            The robot stands there.
        """
        pose = self.chip.truth().map_from_base
        at = pose @ base_from_pillar
        post = (at.x_m, at.y_m, radius_m)
        nothing = np.zeros((0, 4))
        if World(segments_m=nothing, circles_m=np.array([post])).touches(pose, HULL_M):
            raise ThumperError("the robot stands there: put the pillar beside it")
        self._pillars.append(post)
        self._stand()
        return at

    def clear_pillars(self) -> None:
        """Take down what `put_pillar` has put up."""
        self._pillars.clear()
        self._stand()

    def _stand(self) -> None:
        self._scene.stand(np.reshape(self._pillars, (-1, 3)))
        self._contact.look_again(self.world)
        self._seen.change(self.world, self.time_s)

    def is_plugged(self, device: str) -> bool:
        """Whether the USB plug of the `board` or the `lidar` is in."""
        return self._switches.board_plugged if device == "board" else self._switches.lidar_plugged

    def pull_dtr(self) -> None:
        """The host asserts DTR, as when it opens the board's port: that resets a board that is wired so."""
        if self._reset_on_open:
            self.chip.reset()

    def board_write(self, data: bytes) -> None:
        """Send bytes to the board, unless its plug is out."""
        if self._switches.board_plugged:
            self.chip.send(data)

    def board_read(self, limit: int) -> bytes:
        """Fetch up to `limit` bytes that the board has sent; without a plug they are lost."""
        data = self.chip.receive(limit)
        return data if self._switches.board_plugged else b""

    def advance_for_lidar(self, until_s: float, lidar_bytes: int) -> None:
        """Let time pass until `until_s`, or until so many of the lidar's bytes wait to be read."""
        until_cycle = cycle_at(until_s)
        while self.lidar_available() < lidar_bytes and self.chip.cycle < until_cycle:
            self.advance(min(until_s, self.time_s + LIDAR_LOOK_S))

    def lidar_write(self, data: bytes) -> None:
        """Send bytes to the lidar, now, unless its plug is out."""
        self._look()
        if self._switches.lidar_plugged:
            self._lidar.write(data, self.time_s)

    def lidar_available(self) -> int:
        """Bytes from the lidar that wait to be read."""
        self._look()
        self._lidar.advance(self.time_s)
        sent = self._lidar.read()
        if self._switches.lidar_plugged:
            self._lidar_bytes += sent
        return len(self._lidar_bytes)

    def lidar_read(self, limit: int) -> bytes:
        """Fetch up to `limit` bytes from the lidar."""
        self.lidar_available()
        data = bytes(self._lidar_bytes[:limit])
        del self._lidar_bytes[:limit]
        return data

    def _break_what_is_due(self) -> None:
        while self._events and self._events[0].time_s <= self.time_s:
            self._events.popleft().apply(self._switches)

    def _tick(self) -> None:
        self._ticks += 1
        truth = self.chip.truth()
        pose = self._contact.check(truth.map_from_base, TICK_S)
        if self._scene.changes and self._scene.step(truth.time_s, TICK_S, pose.apply(HULL_M)):
            self._contact.look_again(self.world)
            self._seen.change(self.world, truth.time_s)
        self._poses.append((truth.time_s, pose.x_m, pose.y_m, pose.theta_rad))
        self._truth.append((*self._poses[-1], *truth.wheel_rad_s))
        self._lidar.advance(self.time_s)

    def _look(self) -> None:
        if self.time_s > self._poses[-1][0]:
            self._remember()

    def _remember(self) -> None:
        truth = self.chip.truth()
        pose = truth.map_from_base
        self._poses.append((truth.time_s, pose.x_m, pose.y_m, pose.theta_rad))

    def _pose_at(self, times_s: FloatArray) -> FloatArray:
        """The body's pose, shape (n, 3), at times of the last tenth of a second."""
        known = np.array(self._poses)
        headings_rad = np.unwrap(known[:, 3])
        return np.column_stack(
            [
                np.interp(times_s, known[:, 0], known[:, 1]),
                np.interp(times_s, known[:, 0], known[:, 2]),
                np.interp(times_s, known[:, 0], headings_rad),
            ]
        )

    def _pace(self) -> None:
        if self._wall_start_s is not None:
            ahead_s = self.time_s - (time.monotonic() - self._wall_start_s)
            if ahead_s > 0.0:
                time.sleep(ahead_s)
