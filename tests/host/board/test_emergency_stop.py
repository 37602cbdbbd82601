"""The emergency stop is repeated until the board confirms it, however bad the line."""

import pytest

from thumper.board.board import Board
from thumper.board.messages import Command, Fault, State
from thumper.common.errors import ThumperError
from thumper.common.kinematics import WheelSpeeds
from thumper_hil.bench import Bench, simulation


def driving(name: str) -> tuple[Board, Bench]:
    board = Board.open(f"sim://{name}/board", baud=500_000)
    bench = simulation(name)
    board.command(Command.ARM)
    for _ in range(10):
        board.set_wheel_speeds(WheelSpeeds(left_rad_s=5.0, right_rad_s=5.0))
        board.poll(0.5)
    return board, bench


@pytest.mark.parametrize("loss", [0.0, 0.02])
def test_it_is_repeated_until_the_board_confirms_it(loss: float) -> None:
    """With 2 % of bytes lost, 7 of 8 commands (7 bytes) and 1 of 3 telemetry frames (50 bytes) arrive."""
    board, bench = driving(f"stop{loss}")
    bench.fault("line.loss", loss)
    board.emergency_stop()
    bench.fault("line.loss", 0.0)
    last = board.poll(0.5)[-1].telemetry
    assert (last.state, last.fault) == (State.FAULT, Fault.E_STOP)
    assert (last.left_pwm, last.right_pwm) == (0, 0)
    board.close()


def test_without_a_confirmation_the_error_says_to_cut_the_power() -> None:
    board, bench = driving("deaf")
    bench.fault("line.loss", 1.0)
    with pytest.raises(ThumperError, match="cut its power"):
        board.emergency_stop()
    board.close()
