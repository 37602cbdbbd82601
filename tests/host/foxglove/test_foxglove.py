"""The Foxglove server behind its gate, with a client of its own for foxglove.sdk.v1."""

import asyncio
import json
import re
import socket
import ssl
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from websockets.exceptions import InvalidHandshake, InvalidMessage, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from tests.host.bus.test_bus import GRID, TOKEN, M, Robot
from thumper.bus.client import BusClient
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig
from thumper.foxglove.node import FoxgloveNode, PanelParameters
from thumper.foxglove.token_gate import TokenGate
from thumper.ros.codec import decode, definition, encode
from thumper.ros.to_ros import text
from thumper.ros2.gateway import RosGateway
from thumper.ros2.services import RosServices
from thumper.ros2.wire import NodeName
from thumper.runtime.requests import GoTo, Query

SUBPROTOCOLS = [Subprotocol("foxglove.sdk.v1")]
HEADERS = {"Authorization": f"Bearer {TOKEN}"}


class Server:
    """The robot's end of the bus, the Foxglove server, and its gate in its own thread."""

    def __init__(self) -> None:
        self.robot = Robot()
        self.bus = BusClient("r1", self.robot.address)
        parameters = PanelParameters(self.bus, self.robot.reported.append)
        self.node = FoxgloveNode(NodeName(domain_id=0, name="r1"), parameters)
        RosGateway(self.bus, self.node, RobotConfig(name="r1"), self.robot.reported.append)
        RosServices(self.bus, self.node)
        self.backend = self.node.start()
        trust = ssl.create_default_context(cafile=self.node.certificate)
        gate = TokenGate(host="127.0.0.1", port=0, token=TOKEN, backend=self.backend, trust=trust)
        ready = threading.Event()

        def serve() -> None:
            self.loop = asyncio.new_event_loop()

            def on_ready(port: int) -> None:
                self.port = port
                ready.set()

            self._task = self.loop.create_task(gate.serve(on_ready))
            with suppress(asyncio.CancelledError):
                self.loop.run_until_complete(self._task)

        self._thread = threading.Thread(target=serve)
        self._thread.start()
        assert ready.wait(20.0)

    def close(self) -> None:
        self.loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join(20.0)
        self.node.close()
        self.bus.close()
        self.robot.server.close()


class Client:
    """A client that knows the channels and services that the server advertises."""

    def __init__(self, port: int) -> None:
        self.socket: ClientConnection = connect(
            f"ws://127.0.0.1:{port}/?token={TOKEN.replace(' ', '+')}",
            subprotocols=SUBPROTOCOLS,
        )
        self.channels: dict[str, Any] = {}
        self.services: dict[str, Any] = {}
        self.parameters: dict[str, float] | None = None
        self.until(lambda: "/scan" in self.channels and "/r1/arm" in self.services)

    def receive(self) -> bytes:
        """Read one message; return its bytes if it is binary."""
        message = self.socket.recv(timeout=20.0)
        if isinstance(message, bytes):
            return message
        content = json.loads(message)
        self.channels |= {one["topic"]: one for one in content.get("channels", [])}
        self.services |= {one["name"]: one for one in content.get("services", [])}
        if content["op"] == "parameterValues":
            self.parameters = {one["name"]: one["value"] for one in content["parameters"]}
        return b""

    def until(self, condition: Callable[[], bool]) -> None:
        while not condition():
            self.receive()

    def send(self, **content: Any) -> None:
        self.socket.send(json.dumps(content))

    def subscribe(self, topic: str) -> None:
        channel = self.channels[topic]["id"]
        self.send(op="subscribe", subscriptions=[{"id": channel, "channelId": channel}])

    def message(self, topic: str) -> Any:
        """Return the next message of a topic, decoded by the type that the server advertises."""
        channel = self.channels[topic]
        while True:
            raw = self.receive()
            if raw and (raw[0], struct.unpack_from("<I", raw, 1)[0]) == (1, channel["id"]):
                return decode(raw[13:], channel["schemaName"])


@pytest.fixture
def server() -> Iterator[Server]:
    server = Server()
    yield server
    server.close()


@pytest.fixture
def client(server: Server) -> Iterator[Client]:
    client = Client(server.port)
    yield client
    client.socket.close()


def test_channels_have_ros_types(client: Client) -> None:
    scan = client.channels["/scan"]
    assert (scan["encoding"], scan["schemaEncoding"]) == ("cdr", "ros2msg")
    assert scan["schemaName"] == "sensor_msgs/msg/LaserScan"
    assert scan["schema"] == definition("sensor_msgs/msg/LaserScan")
    assert {"/map", "/tf", "/tf_static", "/robot_description", "/diagnostics"} <= set(client.channels)


def test_late_client_receives_map_and_description(server: Server) -> None:
    server.robot.server.publish("map", 0.0, M.grid(0.0, GRID))
    first = Client(server.port)
    first.subscribe("/map")
    first.message("/map")
    late = Client(server.port)
    late.subscribe("/map")
    assert late.message("/map").data.tolist() == list(range(12))
    late.subscribe("/robot_description")
    assert ElementTree.fromstring(late.message("/robot_description").data).get("name") == "r1"
    for one in (first, late):
        one.socket.close()


def test_live_topic(server: Server, client: Client) -> None:
    client.subscribe("/pose")
    stop = threading.Event()

    def publish() -> None:
        while not stop.wait(0.05):
            server.robot.server.publish("pose", 0.0, M.pose(2.0, Pose2(x_m=1.5)))

    thread = threading.Thread(target=publish)
    thread.start()
    pose = client.message("/pose")
    stop.set()
    thread.join()
    assert (pose.header.stamp.sec, pose.pose.pose.position.x) == (2, 1.5)


@pytest.mark.parametrize("schema", ["geometry_msgs/PoseStamped", "geometry_msgs/msg/PoseStamped"])
def test_goal_of_the_panel_becomes_a_request(server: Server, client: Client, schema: str) -> None:
    channel = {"id": 5, "topic": "/goal_pose", "encoding": "cdr", "schemaName": schema}
    client.send(op="advertise", channels=[channel])
    client.socket.send(struct.pack("<BI", 1, 5) + encode(M.goal(0.0, Pose2(x_m=1.0, y_m=-0.5))))
    (request,) = server.robot.received()
    assert isinstance(request, GoTo)
    assert (request.goals[0].x_m, request.goals[0].y_m) == (1.0, -0.5)


def test_channel_of_another_type_or_topic_commands_nothing(server: Server, client: Client) -> None:
    for number, (topic, schema) in enumerate(
        (("/goal_pose", "std_msgs/String"), ("/estop", "std_msgs/Bool"))
    ):
        channel = {"id": number, "topic": topic, "encoding": "cdr", "schemaName": schema}
        client.send(op="advertise", channels=[channel])
        client.socket.send(struct.pack("<BI", 1, number) + encode(text("x")))
    time.sleep(0.5)
    assert server.robot.pending_requests() == []


def test_service_of_the_panel_is_answered(server: Server, client: Client) -> None:
    service = client.services["/r1/arm"]

    def answer() -> None:
        (request,) = server.robot.received()
        assert isinstance(request, Query)
        assert request.content == {"command": "arm"}
        request.reply({"ok": True, "text": "armed"})

    thread = threading.Thread(target=answer)
    thread.start()
    call = struct.pack("<BIII", 2, service["id"], 7, 3) + b"cdr" + b"\0\1\0\0\0"
    client.socket.send(call)
    while not (raw := client.receive()) or raw[0] != 3:
        pass
    thread.join()
    response = decode(raw[16:], "std_srvs/srv/Trigger_Response")
    assert (response.success, response.message) == (True, "armed")


def test_parameters_of_the_panel_are_those_of_the_board(server: Server, client: Client) -> None:
    values = {"kp": 6.0, "ki": 1.0}

    def answer() -> None:
        for _ in range(5):
            (request,) = server.robot.received()
            assert isinstance(request, Query)
            if request.name == "parameters/set":
                values.update(request.content)
            request.reply({"ok": True, "values": values})

    thread = threading.Thread(target=answer)
    thread.start()

    def ask(**content: Any) -> dict[str, float]:
        client.send(**content)
        while client.parameters is None:
            client.receive()
        answered, client.parameters = client.parameters, None
        return answered

    assert ask(op="getParameters", parameterNames=[], id="1") == {"kp": 6.0, "ki": 1.0}
    changed = [{"name": "kp", "value": 7.5, "type": "float64"}]
    assert ask(op="setParameters", parameters=changed, id="2") == {"kp": 7.5}
    for value, kind in (("AAEC", "byte_array"), ([1.0, 2.0], "float64_array")):
        wrong = [{"name": "kp", "value": value, "type": kind}]
        assert ask(op="setParameters", parameters=wrong, id="3") == {"kp": 7.5}
        assert server.robot.reported[-1] == "kp is a number"
    thread.join()


def test_layout_shows_topics_that_exist(client: Client) -> None:
    layout = (Path(__file__).parents[3] / "packaging" / "foxglove-layout.json").read_text(encoding="utf-8")
    topics = set(re.findall(r'"(/[a-z_/]+)(?:\.[a-z_.]+)?"', layout)) - {"/thumper/arm"}
    assert topics - {"/goal_pose", "/initialpose"} <= set(client.channels)
    assert {"/map", "/scan", "/robot_description"} <= topics


@pytest.mark.parametrize("path", ["/", "/?token=wrong", "/?token="])
def test_nobody_connects_without_the_token(server: Server, path: str) -> None:
    with pytest.raises(InvalidStatus, match="401"):
        connect(f"ws://127.0.0.1:{server.port}{path}", subprotocols=SUBPROTOCOLS)
    accepted = connect(
        f"ws://127.0.0.1:{server.port}",
        subprotocols=SUBPROTOCOLS,
        additional_headers=HEADERS,
    )
    accepted.close()


def test_web_pages_do_not_reach_the_server_past_the_gate(server: Server) -> None:
    with pytest.raises((InvalidMessage, InvalidHandshake, OSError)):
        connect(f"ws://127.0.0.1:{server.backend}", subprotocols=SUBPROTOCOLS)
    with pytest.raises(ssl.SSLCertVerificationError):
        connect(f"wss://127.0.0.1:{server.backend}", subprotocols=SUBPROTOCOLS)


def test_junk_and_silence_do_not_stop_the_gate(server: Server) -> None:
    with socket.create_connection(("127.0.0.1", server.port)) as junk:
        junk.sendall(b"\xff" * 20_000)
    with socket.create_connection(("127.0.0.1", server.port)):
        client = Client(server.port)
        client.socket.close()


def test_a_public_address_needs_a_certificate() -> None:
    trust = ssl.create_default_context()
    with pytest.raises(ThumperError, match="needs a certificate"):
        TokenGate(host="0.0.0.0", port=0, token=TOKEN, backend=1, trust=trust)
    with pytest.raises(ThumperError, match="needs a token"):
        TokenGate(host="127.0.0.1", port=0, token="", backend=1, trust=trust)
