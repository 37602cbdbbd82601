"""`thumper save`: save the map of a running robot."""

import queue
import time

from thumper.cli.options.bus import connect
from thumper.cli.options.common import BusAddress, ConfigFile, RobotName

SAVE_TIMEOUT_S = 30.0  # allows for a slow disk


def save(config: ConfigFile = None, bus: BusAddress = "", robot: RobotName = "") -> None:
    """Save a running robot's map and session to its --out folder, and wait until they are written.

    Exits with 1 if that fails.

    Examples:

    - `thumper save`
    - `thumper save --bus 192.168.1.20:7448`
    """
    from thumper.bus.status_watchdog import StatusWatchdog
    from thumper.common.errors import ThumperError
    from thumper.ros import services
    from thumper.ros.services import RunCommand
    from thumper.runtime.service.map_saver import NOT_SAVED, SAVED

    events: queue.Queue[str] = queue.Queue()
    with connect(config, bus, robot) as client:
        client.subscribe("events", lambda message: events.put(message.msg))
        services.COMMAND.call(client, RunCommand(command="save_map"))
        heartbeat, until_s = StatusWatchdog(client), time.monotonic() + SAVE_TIMEOUT_S
        while time.monotonic() < until_s:
            try:
                text = events.get(timeout=0.2)
            except queue.Empty:
                heartbeat.check()
                continue
            if text.startswith(NOT_SAVED):
                raise ThumperError(text)
            if text.startswith(SAVED):
                print(text)
                return
    raise ThumperError(f"the robot did not confirm the save within {SAVE_TIMEOUT_S:.0f} s; check its log")
