"""The status line of `thumper teleop`."""

from types import SimpleNamespace

import pytest

from thumper.cli.teleop import one_row, status_text

ROBOT = {"robot": "thumper", "mode": "idle", "fault_words": "left wheels stalled", "fault_cure": "free them"}


def test_the_line_fits_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert one_row("keyboard: +0.00 m/s") == "\r\033[Kkeyboard: +0.00 m/s"
    assert one_row(200 * "x") == "\r\033[K" + 79 * "x"


@pytest.mark.parametrize(
    ("fault", "state", "text"),
    [
        (0, "DISARMED", "thumper: idle, DISARMED (cancelled)"),
        (3, "FAULT", "thumper: idle, FAULT: left wheels stalled: free them"),
    ],
)
def test_a_fault_is_named_once(fault: int, state: str, text: str) -> None:
    message = SimpleNamespace(**ROBOT, fault=fault, board_state=state, reason="cancelled")
    assert status_text(message) == text
