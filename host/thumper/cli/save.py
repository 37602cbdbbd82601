"""`thumper save`: a running robot leaves its map."""

import queue
import time

from thumper.cli.bus_options import Address, Config, Robot, join

PATIENCE_S = 30.0  # with a slow disk


def save(config: Config = None, bus: Address = "", robot: Robot = "") -> None:
    """Have a running robot write its map and its session into the folder of its --out, and wait for it.

    Leaves with 1 when that fails.
    """
    from thumper.bus.heartbeat_sender import HeartbeatSender
    from thumper.common.errors import ThumperError
    from thumper.runtime.service.map_saver import NOT_SAVED, SAVED

    told: queue.Queue[str] = queue.Queue()
    with join(config, bus, robot) as client:
        client.subscribe("events", lambda message: told.put(message.msg))
        client.query("command", {"command": "save_map"})
        pulse, until_s = HeartbeatSender(client), time.monotonic() + PATIENCE_S
        while time.monotonic() < until_s:
            try:
                text = told.get(timeout=0.2)
            except queue.Empty:
                pulse.check()
                continue
            if text.startswith(NOT_SAVED):
                raise ThumperError(text)
            if text.startswith(SAVED):
                print(text)
                return
    raise ThumperError(f"the robot has not said within {PATIENCE_S:.0f} s that its map is saved")
