"""Test a board with motors and encoders: identity, count direction, speed control, stopping."""

import time
from collections.abc import Callable

import pytest

from thumper.board.board import Board
from thumper.board.messages import PARAMETERS, SCHEMA_HASH, Command, Fault, State, Telemetry
from thumper.common.errors import ThumperError
from thumper.common.kinematics import WheelSpeeds

SPEED_RAD_S = 4.0
PWM = 70
SIDES = ("left", "right")


def follow(board: Board, seconds: float, command: Callable[[], None]) -> list[Telemetry]:
    """Send a command at each telemetry message for `seconds`; return the messages."""
    seen: list[Telemetry] = []
    board.poll(0.0)
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        command()
        seen += [sample.telemetry for sample in board.poll(0.2)]
    assert len(seen) > 3, "the board sends no telemetry"
    return seen


def hold_speed(board: Board, left_rad_s: float, right_rad_s: float) -> Callable[[], None]:
    """Return a command that sets both wheel speeds."""
    speeds = WheelSpeeds(left_rad_s=left_rad_s, right_rad_s=right_rad_s)
    return lambda: board.set_wheel_speeds(speeds)


def stop(board: Board) -> None:
    """Disarm and wait until the wheels are stationary."""
    board.command(Command.DISARM)
    until_s = time.monotonic() + 5.0
    seen: list[Telemetry] = []
    while time.monotonic() < until_s:
        samples = board.poll(0.2)  # empty if this computer is late
        seen += [sample.telemetry for sample in samples[-1:]]
        if samples and seen[-1].left_speed == seen[-1].right_speed == 0:
            return
    assert seen, "the board sends no telemetry"
    pytest.fail("the wheels do not stop within 5 s of DISARM")


def test_board_reports_its_identity(board: Board) -> None:
    assert board.identity.schema_hash == SCHEMA_HASH
    assert board.identity.counts_per_rev > 0
    assert board.identity.control_rate_Hz > 0


def test_board_stores_parameters_and_checks_their_range(board: Board) -> None:
    spec = PARAMETERS[0]
    before = board.get_parameter(spec.name)
    try:
        wanted = round((0.9 * before + 0.05 * spec.maximum) * spec.scale) / spec.scale
        board.set_parameter(spec.name, wanted)
        assert board.get_parameter(spec.name) == pytest.approx(wanted, abs=1.0 / spec.scale)
        with pytest.raises(ThumperError, match="range"):
            board.set_parameter(spec.name, 1.02 * spec.maximum)
        assert board.get_parameter(spec.name) == pytest.approx(wanted, abs=1.0 / spec.scale)
    finally:
        board.set_parameter(spec.name, before)


def test_the_battery_is_measured(board: Board) -> None:
    telemetry = follow(board, 1.0, lambda: None)[-1]
    assert 6400 < telemetry.battery_mV < 13000, "charge the battery, or check its voltage divider"


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("sign", [1, -1])
def test_each_encoder_counts_its_wheel_in_the_right_direction(board: Board, side: str, sign: int) -> None:
    board.command(Command.ARM)
    pwm = (sign * PWM, 0) if side == "left" else (0, sign * PWM)
    seen = follow(board, 0.8, lambda: board.set_motor_pwm(*pwm))
    stop(board)
    turned = {name: getattr(seen[-1], f"{name}_count") - getattr(seen[0], f"{name}_count") for name in SIDES}
    other = "right" if side == "left" else "left"
    assert sign * turned[side] > 50, f"the {side} encoder: loose, or its channels or the motor are swapped"
    assert abs(turned[other]) < abs(turned[side]), "the encoders of left and right are swapped"


@pytest.mark.parametrize("sign", [1, -1])
def test_speed_control_settles(board: Board, sign: int) -> None:
    """The mean speed over half a second is within 10 % from 1.5 s on; the overshoot stays below 30 %."""
    board.command(Command.ARM)
    seen = follow(board, 2.2, hold_speed(board, sign * SPEED_RAD_S, sign * SPEED_RAD_S))
    stop(board)
    for side in SIDES:
        speeds = [sign * getattr(telemetry, f"{side}_speed") / 1000.0 for telemetry in seen]
        assert sum(speeds[-5:]) / 5.0 == pytest.approx(SPEED_RAD_S, rel=0.1)
        assert max(speeds) < 1.3 * SPEED_RAD_S
    assert seen[-1].lost_edges == seen[0].lost_edges


@pytest.mark.provokes(Fault.LINK_LOST)
def test_a_silent_host_stops_the_wheels(board: Board) -> None:
    board.command(Command.ARM)
    follow(board, 1.2, hold_speed(board, SPEED_RAD_S, SPEED_RAD_S))
    seen = follow(board, 1.2, lambda: None)
    assert (seen[-1].state, seen[-1].fault) == (State.FAULT, Fault.LINK_LOST)
    first = next(telemetry for telemetry in seen if telemetry.state is State.FAULT)
    assert (first.time_us - seen[0].time_us) % 2**32 < 500_000
    assert (seen[-1].left_pwm, seen[-1].right_pwm) == (0, 0)
    assert (seen[-1].left_speed, seen[-1].right_speed) == (0, 0)


@pytest.mark.provokes(Fault.E_STOP)
def test_an_emergency_stop_is_latched(board: Board) -> None:
    board.command(Command.ARM)
    follow(board, 1.2, hold_speed(board, SPEED_RAD_S, SPEED_RAD_S))
    board.command(Command.E_STOP)
    seen = follow(board, 1.2, hold_speed(board, SPEED_RAD_S, SPEED_RAD_S))
    assert (seen[-1].state, seen[-1].fault) == (State.FAULT, Fault.E_STOP)
    assert (seen[-1].left_pwm, seen[-1].left_speed, seen[-1].right_speed) == (0, 0, 0)
    with pytest.raises(ThumperError, match="fault is latched"):
        board.command(Command.ARM)
