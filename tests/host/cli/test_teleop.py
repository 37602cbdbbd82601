"""The status line of `thumper teleop`."""

import subprocess
import sys
from types import SimpleNamespace

import pytest

from thumper.cli.teleop import HELP, _newest, _status
from thumper.common.geometry import Twist2

FAULT = {"fault_words": "left wheels stalled"}


@pytest.mark.parametrize(
    ("fault", "board_state", "reason", "line"),
    [
        (0, "DISARMED", "cancelled", "disarmed | +0.20 m/s +0.00 rad/s | cancelled | keyboard"),
        (0, "CLOSED_LOOP", "armed", "armed | +0.20 m/s +0.00 rad/s | keyboard"),
        (0, "CLOSED_LOOP", "driven by teleop", "armed | +0.20 m/s +0.00 rad/s | keyboard"),
        (0, "CLOSED_LOOP", "driven by teleop; slowed", "armed | +0.20 m/s +0.00 rad/s | slowed | keyboard"),
        (3, "FAULT", "", "FAULT, left wheels stalled | +0.20 m/s +0.00 rad/s | c: clear it | keyboard"),
        (0, "", "the board is lost", "+0.20 m/s +0.00 rad/s | the board is lost | keyboard"),
    ],
)
def test_the_line_is_in_plain_words(fault: int, board_state: str, reason: str, line: str) -> None:
    message = SimpleNamespace(**FAULT, fault=fault, board_state=board_state, reason=reason, mode="")
    assert _status(Twist2(v_m_s=0.2), _newest(message), None) == line


def test_the_help_fits_80_columns() -> None:
    assert max(map(len, HELP.splitlines())) < 80


def test_a_gamepad_starts_without_a_word() -> None:
    pytest.importorskip("pygame")
    script = "from thumper.teleop.gamepad import Gamepad; Gamepad().close()"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")
