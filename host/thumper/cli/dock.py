"""`thumper dock`: dock a running robot at its charger, or undock it."""

import queue
import time
from typing import Annotated, Any

import typer

from thumper.cli.options.bus import connect
from thumper.cli.options.common import BusAddress, ConfigFile, RobotName

IDLE_TIMEOUT_S = 20.0  # longer than docking waits for tag or charger with the motors off


class _DockReport:
    """What the robot says of its docking. The callbacks run on the bus's threads."""

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


def dock(
    undock: Annotated[bool, typer.Option("--undock", help="Drive back from the dock.")] = False,
    config: ConfigFile = None,
    bus: BusAddress = "",
    robot: RobotName = "",
) -> None:
    """Dock a running robot at its charger by the tag on it, and wait until it is there. Ctrl-C cancels.

    The robot drives to the saved place `dock` of its map, or to the tag in view. Exits with 1 if it is not
    docked.

    Examples:

    - `thumper dock`
    - `thumper dock --undock`
    """
    from thumper.bus.status_watchdog import StatusWatchdog
    from thumper.common.errors import EXIT_INTERRUPTED, ThumperError
    from thumper.ros import services
    from thumper.ros.services import RunCommand

    command = "undock" if undock else "dock"
    report = _DockReport()
    with connect(config, bus, robot) as client:
        client.subscribe("events", report.on_event)
        client.subscribe("status", report.on_status)
        heartbeat = StatusWatchdog(client)
        try:
            services.COMMAND.call(client, RunCommand(command=command))
            report.restart()
            while True:
                heartbeat.check()
                text = report.next_event()
                if text.startswith(f"not {command}ed"):
                    raise ThumperError(text)
                if text.startswith(f"{command}ed"):
                    print(text)
                    return
                if not text and report.is_idle:
                    raise ThumperError(f"not {command}ed: the robot's motors are off")
        except KeyboardInterrupt:
            services.COMMAND.call(client, RunCommand(command="cancel"))
            raise ThumperError("interrupted; the robot stops", exit_code=EXIT_INTERRUPTED) from None
