"""Stand-in for a browser page, run as a program: arms the robot, then drives it manually, at 20 Hz."""

import sys
import time

from thumper.bus.client import BusClient
from thumper.common.geometry import Twist2
from thumper.ros.to_ros import Messages

AHEAD = Twist2(v_m_s=0.1)

if __name__ == "__main__":
    (address,) = sys.argv[1:]
    messages = Messages()
    with BusClient("thumper", address) as client:
        client.query("command", {"command": "arm"})
        print("armed", flush=True)
        while True:
            client.publish("teleop", messages.twist(0.0, AHEAD))
            time.sleep(0.05)
