"""The gyroscope on the emulated chip's I2C bus: heading, calibration, and every way in which it fails."""

import itertools
import math
from collections.abc import Callable

import pytest

from tests.firmware.board.boot import BUILD
from tests.firmware.board.wire import frames, run_for, send
from thumper.board.framing import encode_frame
from thumper.board.gyroscope import GyroIncrements
from thumper.board.messages import (
    PARAMETERS,
    BoardModel,
    Command,
    CommandRequest,
    Fault,
    GyroscopeState,
    Identify,
    SetParameter,
    SetWheelSpeeds,
    State,
    Telemetry,
)
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.chip_faults import FaultyChip
from thumper_hil.chip.robot_params import RobotParams

INDEX = {spec.name: spec.index for spec in PARAMETERS}
Z_UP, Z_DOWN = 1, 2
DDRC, PORTC, TWBR, TWDR, TWCR = 0x27, 0x28, 0xB8, 0xBB, 0xBC
ADDRESS, WHO_AM_I = 0x68, 0x75
TWINT, TWEN, TWIE = 1 << 7, 1 << 2, 1 << 0
TICK_S, TRY_S, STEP_S = 0.1, 0.2, 0.25e-3
RETRY_S = 0.6
"""Time in which a device that answers again is measuring."""


class Robot:
    """A simulated robot with a gyroscope, and a host that sums what it reports."""

    def __init__(self, board: BoardModel = BoardModel.TREX, mode: int = Z_UP) -> None:
        folder = BUILD if board is BoardModel.TREX else BUILD / board.name.lower()
        self.chip = FaultyChip(folder / "thumper.elf", params=RobotParams.load(), board=board, seed=1)
        self.mode = mode
        self.gyro = GyroIncrements()
        self.turned_rad = self.measured_rad = 0.0
        self.yaw_rad = self.chip.truth().map_from_base.theta_rad
        run_for(self.chip, 0.2)

    def enable(self) -> None:
        """Set the parameter."""
        send(self.chip, SetParameter(index=INDEX["gyroscope"], value=self.mode))

    def drive(self, left_rad_s: float, right_rad_s: float, seconds: float) -> list[Telemetry]:
        """Drive and return the telemetry; add up the true rotation and the measured one."""
        seen = []
        for _ in range(round(seconds / 0.05)):
            send(self.chip, SetWheelSpeeds(left=round(1000 * left_rad_s), right=round(1000 * right_rad_s)))
            run_for(self.chip, 0.05)
            yaw_rad = self.chip.truth().map_from_base.theta_rad
            self.turned_rad += math.remainder(yaw_rad - self.yaw_rad, math.tau)
            self.yaw_rad = yaw_rad
            for frame in frames(self.chip):
                if frame.message_id == Telemetry.ID:
                    seen.append(Telemetry.unpack(frame.payload))
                    self.measured_rad += self.gyro.add(seen[-1]) or 0.0
        return seen

    def arm(self) -> None:
        """Arm at rest."""
        send(self.chip, CommandRequest(command=Command.ARM))


def ready(**fit: float) -> Robot:
    """Return an armed robot whose gyroscope is calibrated."""
    robot = Robot()
    robot.chip.fit_gyroscope(**fit)  # type: ignore[arg-type]
    robot.enable()
    assert robot.drive(0.0, 0.0, 2.0)[-1].gyroscope is GyroscopeState.READY
    robot.arm()
    return robot


@pytest.mark.parametrize("board", [BoardModel.TREX, BoardModel.NANO], ids=lambda board: board.name.lower())
@pytest.mark.parametrize("mode", [Z_UP, Z_DOWN])
def test_the_heading_follows_turns_in_both_directions(board: BoardModel, mode: int) -> None:
    """A bias of 12 deg/s would turn the heading by two revolutions meanwhile."""
    robot = Robot(board, mode)
    robot.chip.fit_gyroscope(bias_deg_s=12.0, upside_down=mode == Z_DOWN)
    robot.enable()
    robot.drive(0.0, 0.0, 2.0)
    robot.arm()
    robot.turned_rad = robot.measured_rad = 0.0
    robot.drive(-6.0, 6.0, 6.0)
    robot.drive(0.0, 0.0, 1.5)
    assert robot.turned_rad > 1.5 * math.tau
    assert robot.measured_rad == pytest.approx(robot.turned_rad, rel=1e-3)
    robot.drive(5.0, -3.0, 6.0)
    last = robot.drive(0.0, 0.0, 1.5)[-1]
    assert robot.measured_rad == pytest.approx(robot.turned_rad, abs=0.02)
    assert (last.state, last.fault, last.lost_edges) == (State.CLOSED_LOOP, Fault.NONE, 0)


def test_the_bus_runs_at_400_kHz() -> None:
    """ATmega328P data sheet, 22.5.2."""
    robot = ready()
    assert CPU_HZ / (16 + 2 * robot.chip.data(TWBR)) == 400_000


def test_the_interrupt_switches_itself_off() -> None:
    """Its flag stays set until the main loop takes the next step: a real chip would call it for ever."""
    chip = ready().chip
    controls = set()
    for _ in range(2 * CPU_HZ // 1000):
        chip.run(chip.cycle + 1)
        controls.add(chip.data(TWCR) & (TWINT | TWEN | TWIE))
    assert TWINT | TWEN in controls
    assert all(control & TWEN for control in controls), "it stays on for the stop condition"


def test_the_pins_stay_untouched_without_the_parameter() -> None:
    robot = Robot()
    robot.chip.fit_gyroscope()
    robot.arm()
    assert {t.gyroscope for t in robot.drive(3.0, 3.0, 1.0)} == {GyroscopeState.OFF}
    assert (robot.chip.data(DDRC), robot.chip.data(PORTC), robot.chip.data(TWCR)) == (0, 0, 0)


def test_a_robot_that_moves_is_not_calibrated() -> None:
    robot = Robot()
    robot.chip.fit_gyroscope(bias_deg_s=3.0)
    robot.enable()
    robot.arm()
    states = [t.gyroscope for t in robot.drive(-3.0, 3.0, 4.0)]
    assert GyroscopeState.READY not in states
    assert states[-1] is GyroscopeState.CALIBRATING
    assert robot.drive(0.0, 0.0, 2.5)[-1].gyroscope is GyroscopeState.READY


def test_a_drifted_bias_is_measured_again_at_each_stop() -> None:
    robot = ready(bias_deg_s=2.0)
    robot.drive(4.0, 4.0, 1.0)
    robot.chip.fit_gyroscope(bias_deg_s=2.8)
    robot.drive(0.0, 0.0, 3.0)
    robot.turned_rad = robot.measured_rad = 0.0
    robot.drive(0.0, 0.0, 2.0)
    assert abs(robot.measured_rad) < math.radians(0.05)


def hold_data(chip: FaultyChip) -> None:
    chip.fit_gyroscope()
    chip.hold_twi_data(pulses=-1)


def hold_clock(chip: FaultyChip) -> None:
    chip.fit_gyroscope()
    chip.hold_twi_clock(held=True)


ABSENT: dict[str, Callable[[FaultyChip], None]] = {
    "absent": lambda chip: None,
    "another device": lambda chip: chip.fit_gyroscope(identity=0x00),
    "data line held low": hold_data,
    "clock line held low": hold_clock,
}


@pytest.mark.parametrize("fault", ABSENT)
def test_without_a_device_the_robot_drives_and_says_so(fault: str) -> None:
    robot = Robot()
    ABSENT[fault](robot.chip)
    robot.enable()
    robot.arm()
    seen = robot.drive(5.0, 4.0, 3.0)
    assert {t.gyroscope for t in seen[2:]} == {GyroscopeState.MISSING}
    assert {b.time_us - a.time_us for a, b in itertools.pairwise(seen)} == {100_000}
    assert (seen[-1].state, seen[-1].fault, seen[-1].tx_dropped) == (State.CLOSED_LOOP, Fault.NONE, 0)
    assert seen[-1].left_speed == pytest.approx(5000, rel=0.1)


def unplug(chip: FaultyChip) -> None:
    chip.power_gyroscope(on=False)


def plug(chip: FaultyChip) -> None:
    chip.power_gyroscope(on=True)


BREAKS: dict[str, tuple[Callable[[FaultyChip], None], Callable[[FaultyChip], None]]] = {
    "unplugged": (unplug, plug),
    "data line held low": (lambda c: c.hold_twi_data(pulses=-1), lambda c: c.hold_twi_data(pulses=0)),
    "clock line held low": (lambda c: c.hold_twi_clock(held=True), lambda c: c.hold_twi_clock(held=False)),
    "frozen": (lambda c: c.freeze_gyroscope(frozen=True), lambda c: c.freeze_gyroscope(frozen=False)),
}


@pytest.mark.parametrize("fault", BREAKS)
def test_a_device_that_dies_is_reported_and_comes_back(fault: str) -> None:
    """The motors go on. No increment spans the gap, and those after it are right again."""
    robot = ready(bias_deg_s=7.0)
    robot.drive(-3.0, 3.0, 1.0)
    breaks, mends = BREAKS[fault]
    breaks(robot.chip)
    seen = robot.drive(-3.0, 3.0, 1.0)
    assert {t.gyroscope for t in seen[3:]} == {GyroscopeState.MISSING}
    assert len({t.heading for t in seen[3:]}) == 1, "it does not turn by the last rate"
    assert {(t.state, t.fault) for t in seen} == {(State.CLOSED_LOOP, Fault.NONE)}
    mends(robot.chip)
    seen = robot.drive(-3.0, 3.0, RETRY_S)
    assert seen[0].gyroscope is GyroscopeState.MISSING
    assert seen[-1].gyroscope is GyroscopeState.READY
    robot.drive(0.0, 0.0, 1.5)
    robot.turned_rad = robot.measured_rad = 0.0
    robot.drive(3.0, -3.0, 2.0)
    robot.drive(0.0, 0.0, 1.5)
    assert robot.measured_rad == pytest.approx(robot.turned_rad, rel=2e-3)


@pytest.mark.parametrize("phase_ms", range(0, 100, 20))
def test_a_device_that_lost_its_settings_gets_them_again(phase_ms: int) -> None:
    """After a dip of its supply it answers, but it sleeps."""
    robot = ready(bias_deg_s=7.0)
    robot.drive(-3.0, 3.0, 1.0)
    run_for(robot.chip, 0.001 * phase_ms)
    unplug(robot.chip)
    plug(robot.chip)
    states = []
    for _ in range(15):
        robot.turned_rad = robot.measured_rad = 0.0
        states += [t.gyroscope for t in robot.drive(-3.0, 3.0, TICK_S)]
        assert robot.measured_rad <= 1.2 * robot.turned_rad, "no reading while its gyroscope starts up"
    assert GyroscopeState.MISSING in states
    assert states[-1] is GyroscopeState.READY


def test_a_busy_main_loop_loses_no_device() -> None:
    """It takes one step of a transfer in each pass, and its passes take milliseconds."""
    robot = ready()
    for _ in range(100):
        robot.chip.send(9 * encode_frame(Identify.ID, 7, Identify().pack()))
        run_for(robot.chip, 0.0025)
    found = [Telemetry.unpack(f.payload) for f in frames(robot.chip) if f.message_id == Telemetry.ID]
    assert {t.gyroscope for t in found} == {GyroscopeState.READY}


@pytest.mark.parametrize("pulses", [1, 9])
def test_nine_clock_pulses_free_the_data_line(pulses: int) -> None:
    """A reset of the board in the middle of a byte leaves the device waiting for the rest of it."""
    robot = Robot()
    robot.chip.fit_gyroscope()
    robot.chip.hold_twi_data(pulses=pulses)
    robot.enable()
    assert robot.drive(0.0, 0.0, RETRY_S)[-1].gyroscope is GyroscopeState.CALIBRATING


def test_a_device_that_stretches_the_clock_for_3_ms_is_not_lost() -> None:
    robot = ready()
    for _ in range(10):
        robot.chip.hold_twi_clock(held=True)
        run_for(robot.chip, 0.003)
        robot.chip.hold_twi_clock(held=False)
        states = {t.gyroscope for t in robot.drive(0.0, 0.0, TICK_S)}
        assert states == {GyroscopeState.READY}


def test_a_device_that_hangs_in_a_byte_comes_back_by_itself() -> None:
    robot = ready()
    robot.chip.hold_twi_data(pulses=9)
    states = [t.gyroscope for t in robot.drive(0.0, 0.0, 1.0)]
    assert GyroscopeState.MISSING in states
    assert states[-1] is GyroscopeState.READY


def test_another_device_is_asked_for_its_name_and_left_alone() -> None:
    robot = Robot()
    robot.chip.fit_gyroscope(identity=0x00)
    robot.enable()
    sent, busy = [], 0
    for _ in range(round(1.5 * TRY_S / STEP_S)):
        for _ in range(10):
            run_for(robot.chip, 0.1 * STEP_S)
            sent.append(robot.chip.data(TWDR))
            busy += bool(robot.chip.data(TWCR) & TWEN)
    assert set(sent[1:]) <= {0xFF, 0x00, ADDRESS << 1, ADDRESS << 1 | 1, WHO_AM_I}
    assert 0 < busy < 10, busy


def test_a_missing_device_gets_nine_clock_pulses_before_each_try() -> None:
    robot = Robot()
    robot.enable()
    levels = []
    for _ in range(round(2 * TRY_S / STEP_S)):
        run_for(robot.chip, STEP_S)
        levels.append(robot.chip.data(DDRC))
    assert sum(a != b for a, b in itertools.pairwise(levels)) == 2 * 2 * 9


def test_a_gap_always_reaches_the_host() -> None:
    """The device fails for a moment between two control ticks; the second one still reports it."""
    robot = ready()
    robot.drive(-3.0, 3.0, 1.0)
    unplug(robot.chip)
    run_for(robot.chip, 0.01)
    plug(robot.chip)
    assert GyroscopeState.MISSING in {t.gyroscope for t in robot.drive(-3.0, 3.0, 2 * TICK_S)}


def test_switching_it_off_releases_the_bus() -> None:
    """After transfers, and in the middle of the pulses that free the bus."""
    robot = Robot()
    robot.chip.fit_gyroscope()
    robot.enable()
    assert robot.drive(0.0, 0.0, RETRY_S)[-1].gyroscope is GyroscopeState.CALIBRATING
    send(robot.chip, SetParameter(index=INDEX["gyroscope"], value=0))
    run_for(robot.chip, 0.01)
    assert (robot.chip.data(DDRC), robot.chip.data(TWCR) & TWEN) == (0, 0)
    for pulse_ms in range(1, 5):
        robot.enable()
        run_for(robot.chip, 0.001 * pulse_ms)
        send(robot.chip, SetParameter(index=INDEX["gyroscope"], value=0))
        run_for(robot.chip, 0.01)
        assert robot.chip.data(DDRC) == 0
