"""Set and read parameters through the host's client; invalid values are refused with a message."""

import math

import pytest

from thumper.board.board import Board
from thumper.common.errors import ThumperError


def test_parameter_is_stored_and_read_back() -> None:
    board = Board.open("sim://parameters/board?world=lab", baud=500_000)
    try:
        board.set_parameter("kp", 7.25)
        assert board.get_parameter("kp") == pytest.approx(7.25, abs=0.01)
        for wrong in (61.0, -1.0, 1e12, math.inf, math.nan):
            with pytest.raises(ThumperError, match=r"kp.*out of range"):
                board.set_parameter("kp", wrong)
        with pytest.raises(ThumperError, match=r"unknown board parameter 'k_p'"):
            board.set_parameter("k_p", 1.0)
        assert board.get_parameter("kp") == pytest.approx(7.25, abs=0.01)
    finally:
        board.close()
