"""Start a task of a running robot by a command on the bus, and follow it to its end."""

import queue
import time
from collections.abc import Callable
from typing import Any

from thumper.bus.client import BusClient
from thumper.bus.status_watchdog import StatusWatchdog
from thumper.common.errors import EXIT_INTERRUPTED, ThumperError
from thumper.ros import services
from thumper.ros.services import RunCommand

IDLE_TIMEOUT_S = 20.0  # longer than a task waits with the motors off, as for a charger or the next frontier


class TaskReport:
    """What the robot reports of its task. The callbacks run on the bus's threads."""

    def __init__(self) -> None:
        self._events: queue.Queue[str] = queue.Queue()
        self._driven_s = time.monotonic()

    def on_event(self, message: Any) -> None:
        """Store the text of an event."""
        self._events.put(message.msg)

    def on_status(self, message: Any) -> None:
        """Note when the robot last drove."""
        if message.mode != "idle":
            self._driven_s = time.monotonic()

    def restart(self) -> None:
        """Forget the events so far: they belong to an earlier task."""
        while not self._events.empty():
            self._events.get_nowait()
        self._driven_s = time.monotonic()

    def next_event(self) -> str:
        """Return the next event, or nothing after 0.2 s."""
        try:
            return self._events.get(timeout=0.2)
        except queue.Empty:
            return ""

    @property
    def is_idle(self) -> bool:
        """Whether the motors have been off for `IDLE_TIMEOUT_S`."""
        return time.monotonic() - self._driven_s > IDLE_TIMEOUT_S


def follow_task(
    client: BusClient,
    command: str,
    *,
    is_done: Callable[[str], bool],
    failed: str,
    show: Callable[[str], None] = lambda _: None,
) -> str:
    """Send `command`, pass the robot's events to `show`, and return the one that `is_done`. Ctrl-C cancels.

    Raises
    ------
    ThumperError
        The robot refuses the command, an event starts with `failed`, the motors stay off, or Ctrl-C.
    """
    report = TaskReport()
    client.subscribe("events", report.on_event)
    client.subscribe("status", report.on_status)
    heartbeat = StatusWatchdog(client)
    try:
        show(services.COMMAND.call(client, RunCommand(command=command)).text)
        report.restart()
        while True:
            heartbeat.check()
            text = report.next_event()
            if text.startswith(failed):
                raise ThumperError(text)
            if text and is_done(text):
                return text
            if text:
                show(text)
            elif report.is_idle:
                raise ThumperError(f"{failed}: the robot's motors are off")
    except KeyboardInterrupt:
        services.COMMAND.call(client, RunCommand(command="cancel"))
        raise ThumperError("interrupted; the robot stops", exit_code=EXIT_INTERRUPTED) from None
