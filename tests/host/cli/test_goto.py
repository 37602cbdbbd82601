"""`thumper goto` cancels its goal at Ctrl-C, whenever it comes."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import pytest

from thumper.cli import goto
from thumper.common.errors import EXIT_INTERRUPTED, ThumperError


class Client:
    """Answers queries; Ctrl-C comes during one of them."""

    def __init__(self, interrupted: str) -> None:
        self._interrupted = interrupted
        self.sent: list[str] = []

    def query(self, name: str, payload: Mapping[str, Any], *, source: str = "") -> Mapping[str, Any]:
        del source
        self.sent.append(payload.get("command", name))
        if name == self._interrupted:
            raise KeyboardInterrupt
        return {"ok": True, "mission": 1, "text": ""}


@pytest.mark.parametrize("moment", ["mission/send", "mission/state"])
def test_ctrl_c_cancels_the_goal(moment: str, monkeypatch: pytest.MonkeyPatch) -> None:
    client = Client(moment)

    @contextmanager
    def connect(*_: object) -> Iterator[Client]:
        yield client

    monkeypatch.setattr(goto, "connect", connect)
    with pytest.raises(ThumperError, match="goal cancelled") as interrupted:
        goto.goto("1.0", 0.5)
    assert interrupted.value.exit_code == EXIT_INTERRUPTED
    assert client.sent[-1] == "cancel"
