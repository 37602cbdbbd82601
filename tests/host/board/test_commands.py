"""Motion commands on a bad line: one wrong bit or lost byte must not cost a command.

Two lost commands stop the robot.
"""

from collections.abc import Callable, Iterator

import pytest

from thumper.board.board import Board
from thumper.board.framing import FrameDecoder
from thumper.common.kinematics import WheelSpeeds
from thumper_hil.bench import simulation

SendCommand = Callable[[Board, float], None]


def closed_loop(board: Board, value: float) -> None:
    board.set_wheel_speeds(WheelSpeeds(left_rad_s=value, right_rad_s=-value))


def open_loop(board: Board, value: float) -> None:
    board.set_motor_pwm(round(value), 0)


def wire_bytes(send: SendCommand, value: float, monkeypatch: pytest.MonkeyPatch) -> bytes:
    """Return the bytes that one command sends."""
    board = Board.open("sim://commands/board", baud=500_000)
    chip = simulation("commands").chip
    with monkeypatch.context() as patch:
        sent: list[bytes] = []
        patch.setattr(chip, "send", sent.append)
        send(board, value)
    board.close()
    return b"".join(sent)


def damage(data: bytes) -> Iterator[bytes]:
    """Yield every result of one wrong bit or one lost byte."""
    for place in range(len(data)):
        yield data[:place] + data[place + 1 :]
        for bit in range(8):
            yield data[:place] + bytes((data[place] ^ 1 << bit,)) + data[place + 1 :]


@pytest.mark.parametrize("send", [closed_loop, open_loop])
def test_one_line_error_costs_no_command(send: SendCommand, monkeypatch: pytest.MonkeyPatch) -> None:
    """All three commands arrive, whichever byte of the middle one is damaged, delimiters included."""
    before, middle, after = (wire_bytes(send, value, monkeypatch) for value in (1.0, 2.0, 3.0))
    whole = [FrameDecoder().feed(data)[0].payload for data in (before, middle, after)]
    for damaged in damage(middle):
        received = [frame.payload for frame in FrameDecoder().feed(before + damaged + after)]
        assert sorted(set(received), key=whole.index) == whole, damaged.hex()
