"""The simulation bench: chip, robot body, world and lidar on one simulated clock."""

import math
import time
from collections import deque
from pathlib import Path

import numpy as np

from thumper.board.firmware_image import firmware_image
from thumper.board.messages import BoardModel
from thumper.common.errors import EXIT_CHECK_FAILED, EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.bench.body_trajectory import BodyTrajectory
from thumper_hil.bench.collision import FOOTPRINT_M, ContactDetector
from thumper_hil.bench.ground_truth import GroundTruth
from thumper_hil.bench.hardware import make_lidar, robot_params
from thumper_hil.bench.leg_contacts import LegContacts
from thumper_hil.bench.options import BenchOptions
from thumper_hil.bench.sensor_line import SensorLine, SimulatedSensor
from thumper_hil.bench.sensor_table import SENSORS, Surroundings
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.chip_faults import FaultyChip
from thumper_hil.chip.instrumented_chip import ATMEGABOOT
from thumper_hil.effects.host_time import HostTime
from thumper_hil.effects.pitch import Pitch
from thumper_hil.effects.preset import load_preset
from thumper_hil.faults.catalogue import FaultError, FaultValue, fault_action
from thumper_hil.faults.scenario import load_scenario
from thumper_hil.faults.switches import Switches
from thumper_hil.world.load_world import load_world
from thumper_hil.world.ramps import climb_rad
from thumper_hil.world.scene import NO_SEGMENTS, Scene
from thumper_hil.world.sills import pitch_over_sills_rad
from thumper_hil.world.start_pose import invalid_start_reason
from thumper_hil.world.world import World
from thumper_hil.world.world_history import WorldHistory

ELF_BY_BOARD = {kind: firmware_image(kind.name.lower(), "elf") for kind in BoardModel}
DEFAULT_ELF = ELF_BY_BOARD[BoardModel.TREX]
TICK_S = 0.01
"""Period at which ground truth is recorded and contacts are checked."""

SENSOR_POLL_S = 0.001
GYRO_BIAS_DEG_S = 15.0  # of an MPU-6050, at most 20 (data sheet, ZRO)
RADIUS_M = 0.062


def cycle_at(time_s: float, clock_Hz: float = CPU_HZ) -> int:
    """Return the first cycle at or after `time_s`, so that a wait until `time_s` always ends."""
    cycle = math.ceil(time_s * clock_Hz)
    return cycle if cycle / clock_Hz >= time_s else cycle + 1  # the product above may round down


def load_world_for(options: BenchOptions) -> World:
    """Return the world; raise ThumperError if it is unknown or the start pose is not free."""
    dark_legs_share = load_preset(options.preset).house.dark_legs_share
    world = load_world(options.world, dark_legs_share=dark_legs_share)
    if reason := invalid_start_reason(world, options.start, FOOTPRINT_M):
        raise ThumperError(
            f"a robot at x_m={options.x_m:g}, y_m={options.y_m:g}, yaw_deg={options.yaw_deg:g} {reason} "
            f"of {options.world}; choose a free start",
            exit_code=EXIT_USAGE,
        )
    return world


def _bootloader() -> Path:
    if not ATMEGABOOT.exists():
        raise ThumperError(
            f"no boot loader at {ATMEGABOOT}; run `sudo apt install arduino-core-avr`",
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
        self._scene = Scene(load_world_for(options))
        preset = load_preset(options.preset)
        self.host = HostTime(preset.host, options.seed)
        self._pitch = Pitch(preset.body, options.seed)
        params = robot_params(options, preset)
        self.battery = params.battery  # as it was at the start
        self.chip = FaultyChip(
            elf or ELF_BY_BOARD[options.board],
            params=params,
            board=options.board,
            seed=options.seed,
        )
        bias_deg_s = np.random.default_rng((options.seed, 0x6050)).uniform(-GYRO_BIAS_DEG_S, GYRO_BIAS_DEG_S)
        self.chip.fit_gyroscope(bias_deg_s=float(bias_deg_s))
        self._clock_Hz = self.chip.clock_Hz
        self._tick_cycles = round(TICK_S * self._clock_Hz)
        self._reset_on_open = options.reset_on_open
        self._options = options
        if options.bare:
            self.chip.install_bootloader(_bootloader())
        elif options.reset_on_open:
            self.chip.add_bootloader(_bootloader())
        self.chip.place(options.start)
        self._switches = Switches(chip=self.chip)
        self._events = deque(load_scenario(Path(options.scenario)) if options.scenario else ())
        self._contact = ContactDetector(self.chip, self.world)
        self._truth = GroundTruth()
        self._legs = LegContacts(FOOTPRINT_M)
        self._track = BodyTrajectory()
        self._ticks = 0
        self._pillars: list[tuple[float, float, float]] = []
        self._record_pose()
        self._history = WorldHistory(self.world)
        self._around = Surroundings(
            options=options, track=self._track, world=lambda: self.world, faults=self._switches
        )
        self._lines: dict[str, SensorLine] = {}
        self._connect("lidar", make_lidar(options, preset, self.world, self._history, self._track))
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
    def world_name(self) -> str:
        """The name or path of the world."""
        return self._options.world

    @property
    def contacts(self) -> int:
        """Number of times the robot's footprint has hit an obstacle or a person."""
        return self._contact.count + self._legs.by_robot

    @property
    def touches_by_people(self) -> int:
        """Number of times a person has walked into the robot."""
        return self._scene.touches_by_people + self._legs.by_people

    def truth(self) -> FloatArray:
        """Return the ground truth of up to two hours at 100 Hz, shape (n, 6), as `ground_truth` says.

        The pose is in the world frame with the heading in [-pi, pi]. The wheel speeds are the true ones,
        positive forward.
        """
        return self._truth.rows()

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
        until_cycle = cycle_at(until_s, self._clock_Hz)
        arrived = False
        while True:
            self._apply_due_faults()
            # While the host computer hangs, time passes and nothing reads the arriving bytes.
            awake_cycle = math.ceil(self._switches.host_hangs_until_s * self._clock_Hz)
            hangs = self.chip.cycle < awake_cycle
            end_cycle = max(until_cycle, awake_cycle)
            if self.chip.cycle >= end_cycle or (arrived and not hangs):
                break
            tick_cycle = (self._ticks + 1) * self._tick_cycles
            fault_cycle = cycle_at(self._events[0].time_s, self._clock_Hz) if self._events else end_cycle
            arrived = self.chip.run(
                min(end_cycle, tick_cycle, fault_cycle), bytes_wanted=0 if hangs else board_bytes
            )
            if self.chip.cycle >= tick_cycle:
                self._tick()
        self._wait_for_real_time()

    def fault(self, name: str, value: FaultValue) -> None:
        """Set or clear a fault, e.g. `bench.fault("encoder.left.b", "cut")`; docs/howto/bench.md lists all.

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
        """Return True if the USB plug of the board or of a sensor is connected."""
        return device not in self._switches.unplugged

    def power_up(self, device: str) -> None:
        """Switch a sensor on when its port opens first. Later, bytes sent meanwhile are lost.

        Board and lidar are on from the start.
        """
        if device not in SENSORS:
            return
        self._refresh_pose()
        if device in self._lines:
            self._lines[device].clear(self.time_s)
        else:
            self._connect(device, SENSORS[device](self._around, self.time_s))

    def _connect(self, name: str, sensor: SimulatedSensor) -> None:
        self._lines[name] = SensorLine(sensor, lambda: self.is_plugged(name))

    def assert_dtr(self) -> None:
        """Assert DTR, as a host does when it opens the port; with `reset_on_open` this resets the board."""
        if self._reset_on_open:
            self.chip.reset()

    def board_write(self, data: bytes) -> None:
        """Send bytes to the board, if it is plugged in."""
        if self.is_plugged("board"):
            self.chip.send(data)

    def board_read(self, limit: int) -> bytes:
        """Read up to `limit` bytes from the board; they are lost while it is unplugged."""
        data = self.chip.receive(limit)
        return data if self.is_plugged("board") else b""

    def advance_for_sensor(self, name: str, until_s: float, wanted_bytes: int) -> None:
        """Advance time to `until_s`, or until `wanted_bytes` bytes from the sensor wait to be read."""
        until_cycle = cycle_at(until_s, self._clock_Hz)
        while self.sensor_available(name) < wanted_bytes and self.chip.cycle < until_cycle:
            self.advance(min(until_s, self.time_s + SENSOR_POLL_S))

    def set_baud(self, name: str, baud: int) -> None:
        """Set the host's baud rate on a sensor's line; 0 if it is unknown."""
        self._lines[name].host_baud = baud

    def set_dtr(self, name: str, level: bool) -> None:
        """Set the line DTR of a sensor's adapter, which runs the motor of some lidars."""
        self._refresh_pose()
        self._lines[name].set_dtr(level, self.time_s)

    def sensor_write(self, name: str, data: bytes) -> None:
        """Send bytes to the sensor now, if it is plugged in."""
        self._refresh_pose()
        self._lines[name].write(data, self.time_s)

    def sensor_available(self, name: str) -> int:
        """Return the number of bytes from the sensor that wait to be read."""
        self._refresh_pose()
        return self._lines[name].available(self.time_s)

    def sensor_read(self, name: str, limit: int) -> bytes:
        """Read up to `limit` bytes from the sensor."""
        self._refresh_pose()
        return self._lines[name].read(limit, self.time_s)

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
        if self.world.legs_m.size:
            self._legs.check(pose, self.world.legs_m, TICK_S)
        pitch_rad = self._pitch.step(RADIUS_M * sum(truth.wheel_rad_s) / 2.0, TICK_S)
        pitch_rad += pitch_over_sills_rad(pose, self.world.sills_m)
        if self.world.ramps_m.size:
            floor_rad = climb_rad(pose, self.world.ramps_m)
            self.chip.set_climb(floor_rad)
            pitch_rad -= floor_rad
        self._track.add(truth.time_s, pose, pitch_rad)
        self.chip.set_attitude(pitch_rad=pitch_rad, roll_rad=self._switches.roll_rad)
        self._truth.add((truth.time_s, pose.x_m, pose.y_m, pose.theta_rad, *truth.wheel_rad_s))
        for line in self._lines.values():
            line.advance(self.time_s)

    def _refresh_pose(self) -> None:
        if self.time_s > self._track.newest_s:
            self._record_pose()

    def _record_pose(self) -> None:
        truth = self.chip.truth()
        self._track.add(truth.time_s, truth.map_from_base)

    def _wait_for_real_time(self) -> None:
        if self._wall_start_s is not None:
            ahead_s = self.time_s - (time.monotonic() - self._wall_start_s)
            if ahead_s > 0.0:
                time.sleep(ahead_s)
