"""Motion orders on a bad line: one wrong bit or lost byte may not cost one, for two lost stop the robot."""

from collections.abc import Callable, Iterator

import pytest

from thumper.board.board import Board
from thumper.board.framing import FrameDecoder
from thumper.common.kinematics import WheelSpeeds
from thumper_hil.bench import simulation

Order = Callable[[Board, float], None]


def in_closed_loop(board: Board, value: float) -> None:
    board.set_wheel_speeds(WheelSpeeds(left_rad_s=value, right_rad_s=-value))


def by_hand(board: Board, value: float) -> None:
    board.set_motor_pwm(round(value), 0)


def wire_bytes(order: Order, value: float, monkeypatch: pytest.MonkeyPatch) -> bytes:
    """What goes down the line for one order."""
    board = Board.open("sim://orders/board", baud=500_000)
    chip = simulation("orders").chip
    with monkeypatch.context() as patch:
        sent: list[bytes] = []
        patch.setattr(chip, "send", sent.append)
        order(board, value)
    board.close()
    return b"".join(sent)


def spoilt(data: bytes) -> Iterator[bytes]:
    """Yield all that comes of one wrong bit, or of one lost byte."""
    for place in range(len(data)):
        yield data[:place] + data[place + 1 :]
        for bit in range(8):
            yield data[:place] + bytes((data[place] ^ 1 << bit,)) + data[place + 1 :]


@pytest.mark.parametrize("order", [in_closed_loop, by_hand])
def test_one_fault_on_the_line_costs_no_order(order: Order, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever one byte suffers, delimiters too: all three orders arrive, the middle one spoilt."""
    before, middle, after = (wire_bytes(order, value, monkeypatch) for value in (1.0, 2.0, 3.0))
    whole = [FrameDecoder().feed(data)[0].payload for data in (before, middle, after)]
    for damaged in spoilt(middle):
        heard = [frame.payload for frame in FrameDecoder().feed(before + damaged + after)]
        assert sorted(set(heard), key=whole.index) == whole, damaged.hex()
