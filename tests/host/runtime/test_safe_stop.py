"""The stop at every exit: ramp down, then disarm, whatever the board and the user do meanwhile."""

from collections.abc import Callable
from typing import Any, cast

import pytest
from benchmarks.shared.telemetry import telemetry_sample

from thumper.board.board import TelemetrySample
from thumper.board.messages import Command
from thumper.common.errors import ThumperError
from thumper.common.kinematics import WheelSpeeds
from thumper.runtime.safe_stop import StopResult, stop_and_disarm

STILL, TURNING = telemetry_sample(0.0), telemetry_sample(0.0, left_speed=300, right_speed=300)


class Board:
    """Notes what it is sent; `answers[k]` is what poll number k returns, the last one for ever."""

    def __init__(self, *answers: list[TelemetrySample], disturb: Callable[[str], None] | None = None) -> None:
        self.sent: list[Any] = []
        self._answers, self._polls = answers, 0
        self._disturb = disturb or (lambda _: None)

    def set_wheel_speeds(self, speeds: WheelSpeeds) -> None:
        self.sent.append(speeds)

    def poll(self, timeout_s: float) -> list[TelemetrySample]:
        assert 0.1 < timeout_s < 0.3  # the board stops by itself after 0.3 s without a command
        self._disturb("poll")
        answer = self._answers[min(self._polls, len(self._answers) - 1)]
        self._polls += 1
        return answer

    def command(self, command: Command) -> None:
        self._disturb("disarm")
        self.sent.append(command)


def stopped(board: Board) -> StopResult:
    return stop_and_disarm(cast("Any", board))


def test_wheels_ramp_down_before_the_motors_go_off() -> None:
    one_side = telemetry_sample(0.0, right_speed=5)
    board = Board([TURNING], [one_side], [TURNING, STILL])
    result = stopped(board)
    assert board.sent == [WheelSpeeds()] * 3 + [Command.DISARM]
    assert result == StopResult(
        samples=[TURNING, one_side, TURNING, STILL], confirmed=True, interrupted=False
    )


def test_ramp_ends_after_three_seconds() -> None:
    board = Board([TURNING])
    assert stopped(board).confirmed
    assert board.sent == [WheelSpeeds()] * 30 + [Command.DISARM]


def test_silent_board_is_disarmed_after_three_silent_cycles() -> None:
    board = Board([TURNING], [], [], [TURNING], [])  # lost frames before are forgiven
    assert stopped(board).confirmed
    assert board.sent == [WheelSpeeds()] * 7 + [Command.DISARM]


def test_ctrl_c_cuts_the_ramp_but_not_the_disarming() -> None:
    interrupts = {"poll": 1, "disarm": 2}

    def press(where: str) -> None:
        interrupts[where] -= 1
        if interrupts[where] >= 0:
            raise KeyboardInterrupt

    board = Board([TURNING], disturb=press)
    result = stopped(board)
    assert board.sent == [WheelSpeeds(), Command.DISARM]
    assert result == StopResult(samples=[], confirmed=True, interrupted=True)


@pytest.mark.parametrize("where", ["poll", "disarm"])
def test_board_that_does_not_answer_is_reported_not_raised(where: str) -> None:
    def fail(place: str) -> None:
        if place == where:
            raise ThumperError("gone")

    result = stopped(Board([STILL], disturb=fail))
    assert not (result.confirmed)
    assert not (result.interrupted)


def test_a_programming_error_is_not_hidden() -> None:
    def fail(_: str) -> None:
        raise ValueError("wrong")

    with pytest.raises(ValueError, match="wrong"):
        stopped(Board([STILL], disturb=fail))
