"""Every board's firmware passes the same tests on the simulated robot, wired by that board's pin map."""

import math
from collections.abc import Iterator
from itertools import pairwise
from statistics import median

import pytest

from tests.firmware.board.boot import BUILD, ELF
from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import BoardModel, Command, Fault, State
from thumper.common.errors import ThumperError
from thumper.common.kinematics import WheelSpeeds
from thumper_hil.bench import Bench, simulation
from thumper_hil.bench.bench import ELF_BY_BOARD
from thumper_hil.chip.chip import CPU_HZ, Chip

OCR2A, OCR2B = 0xB3, 0xB4
TIMSK0, OCIE0B = 0x6E, 1 << 2
PORTB, PORTD, PWM_PIN = 0x25, 0x2B, 1 << 3


class Robot:
    """A simulated robot with one board, and its simulated time."""

    def __init__(self, kind: BoardModel, options: str = "") -> None:
        name = f"board-{kind.name.lower()}"
        self.board = Board.open(f"sim://{name}/board?board={kind.name.lower()}{options}", baud=500_000)
        self.bench: Bench = simulation(name)

    def drive(self, left_rad_s: float, right_rad_s: float, seconds: float) -> list[TelemetrySample]:
        """Command the speeds at each telemetry message; return the telemetry."""
        samples = []
        until_s = self.bench.time_s + seconds
        while self.bench.time_s < until_s:
            self.board.set_wheel_speeds(WheelSpeeds(left_rad_s=left_rad_s, right_rad_s=right_rad_s))
            samples += self.board.poll(0.5)
        return samples


@pytest.fixture(params=list(BoardModel), ids=lambda kind: kind.name.lower())
def kind(request: pytest.FixtureRequest) -> BoardModel:
    """Each board in turn."""
    board: BoardModel = request.param
    return board


@pytest.fixture(autouse=True)
def _tested_build(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the simulated robots run the build that is tested."""
    monkeypatch.setitem(ELF_BY_BOARD, BoardModel.TREX, ELF)
    monkeypatch.setitem(ELF_BY_BOARD, BoardModel.NANO, BUILD / "nano" / "thumper.elf")


@pytest.fixture
def robot(kind: BoardModel) -> Iterator[Robot]:
    """Yield a robot with that board and a charged battery."""
    robot = Robot(kind)
    yield robot
    robot.board.close()


def test_identity_reports_the_board(robot: Robot, kind: BoardModel) -> None:
    assert robot.board.identity.board is kind
    assert robot.board.poll(0.5)[-1].telemetry.state is State.DISARMED


@pytest.mark.parametrize(("left_rad_s", "right_rad_s"), [(6.0, 6.0), (6.0, 4.0), (-3.0, 3.0)])
def test_wheels_follow_the_commanded_speeds(robot: Robot, left_rad_s: float, right_rad_s: float) -> None:
    """Both directions, mean of a slow wheel's turn within 2 %, every edge counted; signs of the currents.

    In a wide arc the body drags the inner wheels along: their motor brakes, and its current is negative.
    """
    robot.board.command(Command.ARM)
    robot.drive(left_rad_s, right_rad_s, 2.0)
    last = robot.drive(left_rad_s, right_rad_s, 2.1)[-1].telemetry
    mean = robot.bench.truth()[-210:, 4:6].mean(axis=0)
    assert mean == pytest.approx([left_rad_s, right_rad_s], rel=0.02)
    assert last.lost_edges == 0
    assert last.battery_mV == pytest.approx(1000 * robot.bench.chip.truth().battery_V, abs=100)
    assert last.left_current_mA * left_rad_s > 0
    inner_wheels_brake = 0 < right_rad_s < left_rad_s
    assert (last.right_current_mA * right_rad_s > 0) is not inner_wheels_brake


def test_a_silent_host_stops_the_robot(robot: Robot) -> None:
    """After 300 ms without a command both PWMs are 0; the wheels stop soon after."""
    robot.board.command(Command.ARM)
    robot.drive(6.0, 6.0, 1.5)
    robot.bench.advance(robot.bench.time_s + 0.45)
    assert [robot.bench.chip.data(address) for address in (OCR2A, OCR2B)] == [0, 0]
    robot.bench.advance(robot.bench.time_s + 1.0)
    assert robot.bench.chip.truth().wheel_rad_s == (0.0, 0.0)
    last = robot.board.poll(0.3)[-1].telemetry
    assert (last.state, last.fault) == (State.FAULT, Fault.LINK_LOST)


def test_a_low_battery_prevents_motion(kind: BoardModel) -> None:
    robot = Robot(kind, "&charge=0.02")
    robot.bench.advance(robot.bench.time_s + 5.0)  # it has detected the battery and beeped
    with pytest.raises(ThumperError, match=r"refused|battery"):
        robot.board.command(Command.ARM)
    last = robot.board.poll(0.3)[-1].telemetry
    assert last.fault is Fault.LOW_BATTERY
    assert abs(robot.bench.truth()[-1, 1:3]).max() < 0.01
    robot.board.close()


def test_the_motors_beep_at_2_kHz(robot: Robot) -> None:
    """Pulses of 48 us, 248 us apart, for 200 ms; none at the start."""
    chip = robot.bench.chip
    chip.reset()
    assert not pulses_us(chip, 0.01)
    chip.set_battery(charge=0.0)
    start_s = run_while(chip, beeping=False)
    pulses = pulses_us(chip, 0.01)
    assert median(end_us - begin_us for begin_us, end_us in pulses) == pytest.approx(48.0, abs=2.0)
    assert median(b[0] - a[0] for a, b in pairwise(pulses)) == pytest.approx(248.0, abs=2.0)
    assert run_while(chip, beeping=True) - start_s == pytest.approx(0.2, abs=0.01)


def run_while(chip: Chip, *, beeping: bool) -> float:
    """Return the time [s] at which the tone begins or ends."""
    while bool(chip.data(TIMSK0) & OCIE0B) is beeping:
        assert chip.time_s < 10.0
        chip.run(chip.cycle + CPU_HZ // 10_000)
    return chip.time_s


def pulses_us(chip: Chip, duration_s: float) -> list[tuple[float, float]]:
    """Return when both PWM pins rose and when one fell again, for each whole pulse."""
    pulses, rose_us, was_high = [], math.nan, True
    end = chip.cycle + round(duration_s * CPU_HZ)
    while chip.cycle < end:
        chip.run(chip.cycle + 1)
        is_high = all(chip.data(port) & chip.data(port - 1) & PWM_PIN for port in (PORTB, PORTD))
        if is_high and not was_high:
            rose_us = 1e6 * chip.time_s
        elif was_high and not is_high and math.isfinite(rose_us):
            pulses.append((rose_us, 1e6 * chip.time_s))
        was_high = is_high
    return pulses
