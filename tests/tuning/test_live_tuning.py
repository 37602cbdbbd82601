"""Gains that change while the simulated robot drives with its real firmware."""

from collections.abc import Iterator

import numpy as np
import pytest

from thumper.board.board import Board
from thumper.board.messages import Command, State
from thumper.common.errors import ThumperError
from thumper.common.kinematics import WheelSpeeds
from thumper_tuning.drive.board_gains import next_sample, read_gains
from thumper_tuning.drive.live_tuning import ControllerState, LiveTuning, LiveTuningOptions

URL = "sim://tune_live/board?world=hall&x_m=-6"


@pytest.fixture
def board() -> Iterator[Board]:
    board = Board.open(URL, baud=500_000)
    board.poll(0.5)
    yield board
    board.close()


def _drive(board: Board, live: LiveTuning, ticks: int) -> list[ControllerState]:
    states = []
    for _ in range(ticks):
        board.set_wheel_speeds(WheelSpeeds(left_rad_s=6.0, right_rad_s=6.0))
        states.append(live.tick(next_sample(board, State.CLOSED_LOOP)))
    return states


def test_a_fault_ends_an_experiment_in_plain_words(board: Board) -> None:
    board.emergency_stop()
    with pytest.raises(ThumperError, match="has stopped the motors: emergency stop; fix that first"):
        next_sample(board, State.FAULT)


@pytest.mark.parametrize("changed", [{"kp": 5.0, "ki": 9.0}, {"ks": 10.0, "kv": 15.0}])
def test_gains_change_in_flight_without_a_bump(board: Board, changed: dict[str, float]) -> None:
    live = LiveTuning(board)
    board.command(Command.ARM)
    before = _drive(board, live, 40)[20:]
    target = live.set_gains(**changed)
    during = _drive(board, live, 40)
    assert not live.is_ramping
    assert read_gains(board) == live.gains == target
    still = max(abs(one.left.speed_rad_s - 6.0) for one in before)
    assert max(abs(one.left.speed_rad_s - 6.0) for one in during) < still + 0.15
    live.revert()
    _drive(board, live, 22)
    assert read_gains(board) == live.original


def test_without_a_ramp_the_feed_forward_bumps(board: Board) -> None:
    """The same change at once moves the speed more."""
    live = LiveTuning(board, LiveTuningOptions(ramp_ticks=1))
    board.command(Command.ARM)
    _drive(board, live, 40)
    live.set_gains(ks=10.0, kv=15.0)
    assert max(abs(one.left.speed_rad_s - 6.0) for one in _drive(board, live, 30)) > 0.6


def test_the_controller_signals_add_up(board: Board) -> None:
    live = LiveTuning(board)
    board.command(Command.ARM)
    steady = _drive(board, live, 60)[30:]
    expected = live.gains.ks + live.gains.kv * 6.0
    forward = [one.left.feedforward_pwm for one in steady]
    assert all(value is not None for value in forward)
    # The battery is above 7.4 V, so the board's feed-forward is a little smaller.
    assert np.mean([value for value in forward if value is not None]) == pytest.approx(expected, rel=0.1)
    for one in steady:
        wheel = one.left
        assert wheel.proportional_pwm is not None
        assert wheel.feedforward_pwm is not None
        assert wheel.proportional_pwm + wheel.integral_pwm + wheel.feedforward_pwm == pytest.approx(wheel.pwm)


def test_saved_gains_survive_later_changes(board: Board) -> None:
    live = LiveTuning(board, LiveTuningOptions(ramp_ticks=1))
    board.command(Command.ARM)
    live.set_gains(kp=7.0)
    with pytest.raises(ThumperError, match="still changing"):
        live.save()
    _drive(board, live, 2)
    for _ in live.save():
        board.set_wheel_speeds(WheelSpeeds(left_rad_s=6.0, right_rad_s=6.0))
    live.set_gains(kp=3.0)
    _drive(board, live, 2)
    board.command(Command.DISARM)
    board.command(Command.LOAD)
    assert board.get_parameter("kp") == pytest.approx(7.0, abs=0.001)


def test_a_gain_out_of_range_changes_nothing(board: Board) -> None:
    live = LiveTuning(board)
    with pytest.raises(ThumperError, match="ki = 31"):
        live.set_gains(kp=1.0, ki=31.0)
    assert not live.is_ramping
    assert read_gains(board) == live.original
