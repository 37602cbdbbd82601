"""Stand-in for a browser page, run as a program: sends a goal, then ten heartbeats per second."""

import sys
import time

from thumper.bus.client import BusClient
from thumper.ros.to_ros import Messages

if __name__ == "__main__":
    address, x_m, y_m = sys.argv[1:]
    with BusClient("thumper", address) as client:
        client.publish("heartbeat", Messages().header(0.0))
        print(client.query("mission/send", {"x_m": float(x_m), "y_m": float(y_m)}), flush=True)
        while True:
            client.publish("heartbeat", Messages().header(0.0))
            time.sleep(0.1)
