"""No message of a client that has the token stops the Foxglove server, or commands more than a goal."""

import json
import math
import random
import struct
from contextlib import closing, suppress

from websockets.exceptions import ConnectionClosed

from tests.fuzz.mutate import mutated
from tests.host.bus.test_bus import M
from tests.host.foxglove.test_foxglove import Client, Server
from thumper.common.geometry import Pose2
from thumper.ros.codec import encode
from thumper.runtime.requests import GoTo

CASES = 300
GOAL = {"id": 5, "topic": "/goal_pose", "encoding": "cdr", "schemaName": "geometry_msgs/msg/PoseStamped"}


def test_no_message_stops_the_server() -> None:
    with closing(Server()) as server:
        rng, client = random.Random(1), Client(server.port)
        subscription = {"id": 1, "channelId": client.channels["/map"]["id"]}
        texts = [
            json.dumps({"op": "advertise", "channels": [GOAL]}).encode(),
            json.dumps({"op": "subscribe", "subscriptions": [subscription]}).encode(),
            json.dumps({"op": "unadvertise", "channelIds": [5]}).encode(),
        ]
        arm = client.services["/r1/arm"]["id"]
        binaries = [
            struct.pack("<BI", 1, 5) + encode(M.goal(0.0, Pose2(x_m=1.0, y_m=-0.5))),
            struct.pack("<BIII", 2, arm, 7, 4) + b"cdr?",  # another encoding: never asked of the robot
        ]
        for case in range(CASES):
            try:
                client.socket.send(texts[0].decode())
                if case % 2:
                    client.socket.send(mutated(rng.choice(texts), rng).decode("utf-8", "replace"))
                else:
                    client.socket.send(mutated(rng.choice(binaries), rng))
            except ConnectionClosed:  # the server ends a connection that breaks the protocol
                client = Client(server.port)
        with suppress(ConnectionClosed):
            client.socket.close()
        fresh = Client(server.port)
        fresh.send(op="advertise", channels=[GOAL])
        fresh.socket.send(binaries[0])
        requests = server.robot.received()
        fresh.socket.close()
    goals = [request for request in requests if isinstance(request, GoTo)]
    assert goals
    assert all(math.isfinite(goal.x_m) for request in goals for goal in request.goals)
