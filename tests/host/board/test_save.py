"""SAVE takes a quarter of a second: each byte of the EEPROM takes 3.4 ms."""

import pytest

from thumper.board.board import REPLY_TIMEOUT_S, Board
from thumper.board.messages import Command
from thumper.common.errors import ThumperError
from thumper_hil.bench import simulation


def test_the_first_saves_of_a_board_are_answered() -> None:
    """Both slots of the EEPROM are erased, so each of these saves writes every byte."""
    board = Board.open("sim://saves/board", baud=500_000)
    bench = simulation("saves")
    board.poll(0.5)
    for _ in range(2):
        before_s = bench.time_s
        board.command(Command.SAVE)
        assert bench.time_s - before_s > 2.0 * REPLY_TIMEOUT_S
    board.set_parameter("kp", 12.0)
    board.command(Command.LOAD)
    assert board.get_parameter("kp") == pytest.approx(6.1, abs=1e-3)
    board.close()


def test_without_an_answer_the_error_names_the_command() -> None:
    board = Board.open("sim://unsaved/board", baud=500_000)
    simulation("unsaved").fault("line.loss", 1.0)
    with pytest.raises(ThumperError, match="the board did not answer the save command"):
        board.command(Command.SAVE)
    board.close()
