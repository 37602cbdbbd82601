"""Runs the command line in this process: a new one takes 0.3 s."""

import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest

from thumper.cli import app
from thumper.common.signals import STOP_SIGNALS


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """How a command ended, and what it printed."""

    status: int
    out: str
    err: str


@pytest.fixture
def thumper(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Iterator[Callable[..., Ended]]:
    """Return a function that runs `thumper` with some arguments."""

    def run(*arguments: str) -> Ended:
        monkeypatch.setattr(sys, "argv", ["thumper", *arguments])
        with pytest.raises(SystemExit) as ended:
            app.main()
        printed = capsys.readouterr()
        status = ended.value.code or 0
        assert isinstance(status, int)
        return Ended(status=status, out=printed.out, err=printed.err)

    handlers = {number: signal.getsignal(number) for number in STOP_SIGNALS}  # the command replaces them
    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)
