"""One line shows the newest state: in place on a terminal, a plain one every few seconds elsewhere."""

import sys
import time

import pytest

from thumper.cli.output.status_line import PLAIN_PERIOD_S, StatusLine, one_row


def test_the_line_fits_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert one_row("+0.00 m/s") == "\r\033[K+0.00 m/s"
    assert one_row(200 * "x") == "\r\033[K" + 79 * "x"


def test_a_terminal_shows_only_the_newest(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    line = StatusLine()
    line.show("2 m to go")
    line.show("1 m to go")
    line.clear()
    assert capsys.readouterr().out == "\r\033[K2 m to go\r\033[K1 m to go\r\033[K"


def test_elsewhere_there_are_few_lines(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now_s = 100.0
    monkeypatch.setattr(time, "monotonic", lambda: now_s)
    line = StatusLine()
    for now_s in (100.0, 101.0, 100.0 + PLAIN_PERIOD_S):
        line.show(f"at {now_s:g} s")
    line.clear()
    assert capsys.readouterr().out == f"at 100 s\nat {100.0 + PLAIN_PERIOD_S:g} s\n"
