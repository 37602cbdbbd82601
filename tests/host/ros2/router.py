"""A Zenoh router with the settings of rmw_zenohd, as a program: `python -m tests.host.ros2.router PORT`.

rmw_zenohd is a Zenoh session in router mode (rmw_zenoh_cpp/src/zenohd/main.cpp). So is this, with the keys of
its default configuration that differ from Zenoh's.
"""

import json
import sys
import time
from typing import Any

import zenoh


def open_router(port: int, **more: Any) -> zenoh.Session:
    """Open a router on loopback."""
    config = zenoh.Config()
    settings = {
        "mode": "router",
        "listen/endpoints": [f"tcp/127.0.0.1:{port}"],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": True,
        **more,
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


if __name__ == "__main__":
    router = open_router(int(sys.argv[1]))
    print("ready", flush=True)
    while True:
        time.sleep(3600.0)
