"""The simulation bench: chip, robot body, world and lidar on one simulated clock."""

import math
import time
from collections import deque
from dataclasses import replace
from pathlib import Path

import numpy as np

from thumper.board.firmware_image import firmware_image
from thumper.board.messages import BoardModel
from thumper.common.errors import EXIT_CHECK_FAILED, EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray, Pose2
from thumper.odometry.pose_buffer import interpolate_poses
from thumper_hil.bench.collision import FOOTPRINT_M, ContactDetector
from thumper_hil.bench.options import BenchOptions
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.chip_faults import FaultyChip
from thumper_hil.chip.instrumented_chip import ATMEGABOOT
from thumper_hil.chip.robot_params import RobotParams
from thumper_hil.faults.catalogue import FaultError, FaultValue, fault_action
from thumper_hil.faults.scenario import load_scenario
from thumper_hil.faults.switches import Switches
from thumper_hil.lidars.ld19 import Ld19
from thumper_hil.lidars.urg04lx import Urg04Lx
from thumper_hil.world.scene import NO_SEGMENTS, Scene
from thumper_hil.world.start_pose import invalid_start_reason
from thumper_hil.world.world import World
from thumper_hil.world.world_history import WorldHistory

ELF_BY_BOARD = {kind: firmware_image(kind.name.lower(), "elf") for kind in BoardModel}
DEFAULT_ELF = ELF_BY_BOARD[BoardModel.TREX]
BASE_FROM_LASER = Pose2(x_m=0.12)
TICK_S = 0.01
"""Period at which ground truth is recorded and contacts are checked."""

TICK_CYCLES = round(TICK_S * CPU_HZ)
LIDAR_POLL_S = 0.001
MAX_TRUTH_ROWS = 720_000  # two hours: limits memory when a robot runs for days
MAX_POSES = 256  # a sweep of the lidar takes 75 ms, and a busy reader polls every millisecond
TRUTH_COLUMNS = ("time_s", "x_m", "y_m", "theta_rad", "left_rad_s", "right_rad_s")


def cycle_at(time_s: float) -> int:
    """Return the first cycle at or after `time_s`, so that a wait until `time_s` always ends."""
    cycle = math.ceil(time_s * CPU_HZ)
    return cycle if cycle / CPU_HZ >= time_s else cycle + 1  # the product above may round down


def _bootloader() -> Path:
    if not ATMEGABOOT.exists():
        raise ThumperError(
            f"reset_on_open: no boot loader at {ATMEGABOOT}; run `sudo apt install arduino-core-avr`",
            exit_code=EXIT_CHECK_FAILED,
        )
    return ATMEGABOOT


class Bench:
    """A simulated robot. Time passes only in `advance...`; the same seed and bytes give the same run.

    Raises
    ------
    ThumperError
        Firmware or chip library are not built, the world is unknown, or the start pose is not free.
    """

    def __init__(self, options: BenchOptions, *, elf: Path | None = None) -> None:
        self._scene = Scene(World.load(options.world))
        if reason := invalid_start_reason(self.world, options.start, FOOTPRINT_M):
            raise ThumperError(
                f"a robot at x_m={options.x_m:g}, y_m={options.y_m:g}, yaw_deg={options.yaw_deg:g} {reason} "
                f"of {options.world}; choose a free start",
                exit_code=EXIT_USAGE,
            )
        params = RobotParams.load()
        if options.charge is not None:
            params = replace(params, battery=replace(params.battery, state_of_charge=options.charge))
        self.chip = FaultyChip(
            elf or ELF_BY_BOARD[options.board], params=params, board=options.board, seed=options.seed
        )
        self._reset_on_open = options.reset_on_open
        if options.reset_on_open:
            self.chip.add_bootloader(_bootloader())
        self.chip.place(options.start)
        self._switches = Switches(chip=self.chip)
        self._events = deque(load_scenario(Path(options.scenario)) if options.scenario else ())
        self._contact = ContactDetector(self.chip, self.world)
        self._truth: deque[tuple[float, ...]] = deque(maxlen=MAX_TRUTH_ROWS)
        self._poses: deque[tuple[float, ...]] = deque(maxlen=MAX_POSES)
        self._ticks = 0
        self._pillars: list[tuple[float, float, float]] = []
        self._record_pose()
        self._history = WorldHistory(self.world)
        lidar = Ld19 if options.lidar == "ld19" else Urg04Lx
        self._lidar: Ld19 | Urg04Lx = lidar(
            world=self._history, pose_at=self._pose_at, base_from_laser=BASE_FROM_LASER, seed=options.seed
        )
        self._lidar_bytes = bytearray()
        self._wall_start_s = time.monotonic() if options.realtime else None

    @property
    def time_s(self) -> float:
        """Simulated seconds since power-on."""
        return self.chip.time_s

    @property
    def world(self) -> World:
        """The world in its current state."""
        return self._scene.world

    @property
    def contacts(self) -> int:
        """Number of times the robot's footprint has hit an obstacle or a person."""
        return self._contact.count

    @property
    def bumps(self) -> int:
        """Number of times a person has walked into the robot."""
        return self._scene.bumps

    def truth(self) -> FloatArray:
        """Return the ground truth of up to two hours at 100 Hz, shape (n, 6): columns `TRUTH_COLUMNS`.

        The pose is in the world frame with the heading in [-pi, pi]. The wheel speeds are the true ones,
        positive forward.
        """
        return np.array(self._truth).reshape(-1, len(TRUTH_COLUMNS))

    def clear_truth(self) -> None:
        """Discard the recorded ground truth, to limit memory in long runs."""
        self._truth.clear()

    def advance(self, until_s: float, *, board_bytes: int = 0) -> None:
        """Advance time to `until_s`, or until `board_bytes` bytes from the board wait to be read.

        Raises
        ------
        ChipError
            The firmware crashed.
        """
        until_cycle = cycle_at(until_s)
        arrived = False
        while True:
            self._apply_due_faults()
            # While the host computer hangs, time passes and nothing reads the arriving bytes.
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
        self._wait_for_real_time()

    def fault(self, name: str, value: FaultValue) -> None:
        """Set or clear a fault, e.g. `bench.fault("encoder.left.b", "cut")`; docs/bench.md lists all.

        Raises
        ------
        ThumperError
            The fault is unknown or the value is invalid.
        """
        try:
            fault_action(name, value)(self._switches)
        except FaultError as error:
            raise ThumperError(str(error), exit_code=EXIT_USAGE) from error

    @property
    def pillars(self) -> int:
        """Number of pillars added by `add_pillar`."""
        return len(self._pillars)

    def add_pillar(self, base_from_pillar: Pose2, radius_m: float) -> Pose2:
        """Add a pillar at a pose relative to the robot; return its pose in the world.

        Raises
        ------
        ThumperError
            The robot is at that position.
        """
        pose = self.chip.truth().map_from_base
        at = pose @ base_from_pillar
        pillar = (at.x_m, at.y_m, radius_m)
        if World(segments_m=NO_SEGMENTS, circles_m=np.array([pillar])).touches(pose, FOOTPRINT_M):
            raise ThumperError("the pillar would overlap the robot; place it next to the robot")
        self._pillars.append(pillar)
        self._update_pillars()
        return at

    def clear_pillars(self) -> None:
        """Remove all pillars added by `add_pillar`."""
        self._pillars.clear()
        self._update_pillars()

    def _update_pillars(self) -> None:
        self._scene.set_posts(np.reshape(self._pillars, (-1, 3)))
        self._contact.set_world(self.world)
        self._history.append(self.world, self.time_s)

    def is_plugged(self, device: str) -> bool:
        """Return True if the USB plug of `board` or `lidar` is connected."""
        return self._switches.board_plugged if device == "board" else self._switches.lidar_plugged

    def assert_dtr(self) -> None:
        """Assert DTR, as a host does when it opens the port; with `reset_on_open` this resets the board."""
        if self._reset_on_open:
            self.chip.reset()

    def board_write(self, data: bytes) -> None:
        """Send bytes to the board, if it is plugged in."""
        if self._switches.board_plugged:
            self.chip.send(data)

    def board_read(self, limit: int) -> bytes:
        """Read up to `limit` bytes from the board; they are lost while it is unplugged."""
        data = self.chip.receive(limit)
        return data if self._switches.board_plugged else b""

    def advance_for_lidar(self, until_s: float, lidar_bytes: int) -> None:
        """Advance time to `until_s`, or until `lidar_bytes` bytes from the lidar wait to be read."""
        until_cycle = cycle_at(until_s)
        while self.lidar_available() < lidar_bytes and self.chip.cycle < until_cycle:
            self.advance(min(until_s, self.time_s + LIDAR_POLL_S))

    def lidar_write(self, data: bytes) -> None:
        """Send bytes to the lidar now, if it is plugged in."""
        self._refresh_pose()
        if self._switches.lidar_plugged:
            self._lidar.write(data, self.time_s)

    def lidar_available(self) -> int:
        """Return the number of bytes from the lidar that wait to be read."""
        self._refresh_pose()
        self._lidar.advance(self.time_s)
        sent = self._lidar.read()
        if self._switches.lidar_plugged:
            self._lidar_bytes += sent
        return len(self._lidar_bytes)

    def lidar_read(self, limit: int) -> bytes:
        """Read up to `limit` bytes from the lidar."""
        self.lidar_available()
        data = bytes(self._lidar_bytes[:limit])
        del self._lidar_bytes[:limit]
        return data

    def _apply_due_faults(self) -> None:
        while self._events and self._events[0].time_s <= self.time_s:
            self._events.popleft().apply(self._switches)

    def _tick(self) -> None:
        self._ticks += 1
        truth = self.chip.truth()
        pose = self._contact.check(truth.map_from_base, TICK_S)
        if self._scene.is_dynamic and self._scene.step(truth.time_s, TICK_S, pose.apply(FOOTPRINT_M)):
            self._contact.set_world(self.world)
            self._history.append(self.world, truth.time_s)
        self._poses.append((truth.time_s, pose.x_m, pose.y_m, pose.theta_rad))
        self._truth.append((*self._poses[-1], *truth.wheel_rad_s))
        self._lidar.advance(self.time_s)

    def _refresh_pose(self) -> None:
        if self.time_s > self._poses[-1][0]:
            self._record_pose()

    def _record_pose(self) -> None:
        truth = self.chip.truth()
        pose = truth.map_from_base
        self._poses.append((truth.time_s, pose.x_m, pose.y_m, pose.theta_rad))

    def _pose_at(self, times_s: FloatArray) -> FloatArray:
        """Return the body's pose, shape (n, 3), at times within the last tenth of a second."""
        known = np.array(self._poses)
        return interpolate_poses(times_s, known[:, 0], known[:, 1:])

    def _wait_for_real_time(self) -> None:
        if self._wall_start_s is not None:
            ahead_s = self.time_s - (time.monotonic() - self._wall_start_s)
            if ahead_s > 0.0:
                time.sleep(ahead_s)
