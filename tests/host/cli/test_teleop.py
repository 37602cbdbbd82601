"""The status line of `thumper teleop`."""

from types import SimpleNamespace

import pytest

from thumper.cli.teleop import status_text

ROBOT = {"robot": "thumper", "mode": "idle", "fault_words": "left wheels stalled", "fault_cure": "free them"}


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
