"""`thumper dock` follows its own docking only, and cancels it at Ctrl-C whenever it comes."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest

from thumper.cli import dock, follow_task
from thumper.common.errors import EXIT_INTERRUPTED, ThumperError

EARLIER = "not docked: replaced by another task"


class Client:
    """A robot that docks for another client until it accepts the command of this one."""

    robot = "r1"

    def __init__(self, *events: str, mode: str = "driving", interrupted: bool = False) -> None:
        self._events, self._mode, self._interrupted = events, mode, interrupted
        self._callbacks: dict[str, list[Callable[[Any], None]]] = {}
        self.sent: list[str] = []

    def subscribe(self, topic: str, callback: Callable[[Any], None]) -> None:
        self._callbacks.setdefault(topic, []).append(callback)
        if topic == "status":  # latched
            callback(SimpleNamespace(mode=self._mode))

    def query(self, _name: str, payload: Mapping[str, Any], *, source: str = "") -> Mapping[str, Any]:
        del source
        self.sent.append(payload["command"])
        self._publish(EARLIER)
        if self._interrupted and payload["command"] != "cancel":
            raise KeyboardInterrupt
        return {"ok": True, "text": ""}

    def _publish(self, text: str) -> None:
        for callback in self._callbacks["events"]:
            callback(SimpleNamespace(msg=text))

    def answer(self) -> None:
        for text in self._events:
            self._publish(text)


def run(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    @contextmanager
    def connect(*_: object) -> Iterator[Client]:
        yield client

    class Report(follow_task.TaskReport):
        def restart(self) -> None:
            super().restart()
            client.answer()

    monkeypatch.setattr(dock, "connect", connect)
    monkeypatch.setattr(follow_task, "TaskReport", Report)
    dock.dock()


def test_the_end_of_an_earlier_docking_is_not_its_own(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run(Client("lidar: 10 scans per second", "docked: charging"), monkeypatch)
    assert capsys.readouterr().out == "docked: charging\n"


def test_a_docking_that_another_task_replaces_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ThumperError, match=EARLIER):
        run(Client(EARLIER), monkeypatch)


def test_a_robot_with_its_motors_off_does_not_dock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(follow_task, "IDLE_TIMEOUT_S", 0.0)
    with pytest.raises(ThumperError, match="not docked: the robot's motors are off"):
        run(Client(mode="idle"), monkeypatch)


def test_ctrl_c_during_the_request_cancels_it(monkeypatch: pytest.MonkeyPatch) -> None:
    client = Client(interrupted=True)
    with pytest.raises(ThumperError, match="interrupted") as interrupted:
        run(client, monkeypatch)
    assert interrupted.value.exit_code == EXIT_INTERRUPTED
    assert client.sent == ["dock", "cancel"]
