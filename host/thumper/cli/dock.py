"""`thumper dock`: dock a running robot at its charger, or undock it."""

import queue
from typing import Annotated

import typer

from thumper.cli.options.bus import connect
from thumper.cli.options.common import BusAddress, ConfigFile, RobotName


def dock(
    undock: Annotated[bool, typer.Option("--undock", help="Drive back from the dock.")] = False,
    config: ConfigFile = None,
    bus: BusAddress = "",
    robot: RobotName = "",
) -> None:
    """Dock a running robot at its charger by the tag on it, and wait until it is there. Ctrl-C cancels.

    The robot drives to the saved place `dock` of its map, or to the tag in view. Exits with 1 if it is not
    docked.

    Example: `thumper dock`, `thumper dock --undock`
    """
    from thumper.bus.status_watchdog import StatusWatchdog
    from thumper.common.errors import EXIT_INTERRUPTED, ThumperError
    from thumper.ros import services
    from thumper.ros.services import RunCommand

    command = "undock" if undock else "dock"
    events: queue.Queue[str] = queue.Queue()
    with connect(config, bus, robot) as client:
        client.subscribe("events", lambda message: events.put(message.msg))
        services.COMMAND.call(client, RunCommand(command=command))
        heartbeat = StatusWatchdog(client)
        try:
            while True:
                try:
                    text = events.get(timeout=0.2)
                except queue.Empty:
                    heartbeat.check()
                    continue
                if text.startswith(f"not {command}ed"):
                    raise ThumperError(text)
                if text.startswith(f"{command}ed"):
                    print(text)
                    return
        except KeyboardInterrupt:
            services.COMMAND.call(client, RunCommand(command="cancel"))
            raise ThumperError("interrupted; the robot stops", exit_code=EXIT_INTERRUPTED) from None
