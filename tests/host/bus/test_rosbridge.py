"""The rosbridge server between a real client, roslibpy, and a real Zenoh bus."""

import asyncio
import json
import ssl
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest
import roslibpy
from benchmarks.shared.live import until
from websockets.exceptions import ConnectionClosed, InvalidMessage, InvalidStatus
from websockets.sync.client import connect

from tests.host.bus.test_bus import GRID, TOKEN, M, Robot
from thumper.bus.client import BusClient
from thumper.bus.rosbridge import Rosbridge
from thumper.common.errors import ThumperError
from thumper.common.geometry import Twist2
from thumper.dashboard.certificate import make_certificate, server_tls
from thumper.lidar.scan import Scan
from thumper.runtime.requests import EmergencyStop, Query, Request, TeleopSource, Velocity

HEADERS = {"Authorization": f"Bearer {TOKEN}"}


class Bridge:
    """The robot's end of the bus, and a rosbridge server in its own thread."""

    def __init__(self, tls: ssl.SSLContext | None = None) -> None:
        self.robot = Robot()
        self.bus = BusClient("r1", self.robot.address)
        self.rosbridge = Rosbridge(self.bus, host="127.0.0.1", port=0, token=TOKEN, tls=tls)
        ready = threading.Event()

        def serve() -> None:
            self.loop = asyncio.new_event_loop()

            def on_ready(port: int) -> None:
                self.port = port
                ready.set()

            self._task = self.loop.create_task(self.rosbridge.serve(on_ready))
            with suppress(asyncio.CancelledError):
                self.loop.run_until_complete(self._task)

        self._thread = threading.Thread(target=serve)
        self._thread.start()
        assert ready.wait(20.0)

    @property
    def url(self) -> str:
        """Address as a web page opens it."""
        return f"ws://127.0.0.1:{self.port}/?token={quote(TOKEN)}"

    def stop(self) -> None:
        self.loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join(20.0)
        self.loop.close()

    def close(self) -> None:
        if not self.loop.is_closed():
            self.stop()
        self.bus.close()
        self.robot.server.close()


@pytest.fixture
def bridge() -> Iterator[Bridge]:
    bridge = Bridge()
    yield bridge
    bridge.close()


@pytest.fixture
def ros(bridge: Bridge) -> Iterator[roslibpy.Ros]:
    ros = roslibpy.Ros("127.0.0.1", bridge.port, headers=HEADERS)
    ros.run(timeout=20)
    yield ros
    ros.close()


def receive_from(topic: roslibpy.Topic, publish: Callable[[], None]) -> Any:
    received: list[Any] = []
    topic.subscribe(received.append)

    def is_received() -> bool:
        publish()
        return bool(received)

    until(is_received)
    return received[0]


def test_roslibpy_receives_a_scan(bridge: Bridge, ros: roslibpy.Ros) -> None:
    ranges_m = np.array([1.0, np.nan, np.inf])
    scan = Scan(time_s=1.5, ranges_m=ranges_m, angle_min_rad=-1.0, angle_increment_rad=1.0)
    received = receive_from(
        roslibpy.Topic(ros, "/scan", "sensor_msgs/LaserScan"),
        lambda: bridge.robot.server.publish("scan", 1.5, M.scan(scan)),
    )
    assert received["ranges"] == [1.0, None, None]
    assert received["header"] == {"stamp": {"sec": 1, "nanosec": 500_000_000}, "frame_id": "laser"}


def test_late_roslibpy_client_receives_the_map(bridge: Bridge, ros: roslibpy.Ros) -> None:
    bridge.robot.server.publish("map", 0.0, M.grid(0.0, GRID))
    until(lambda: bridge.robot.server.statistics.sent == 1)
    for _ in range(2):  # for the second client the bridge has the map already
        received = receive_from(roslibpy.Topic(ros, "/map", "nav_msgs/OccupancyGrid"), lambda: None)
        assert received["data"] == list(range(12))


def test_roslibpy_drives(bridge: Bridge, ros: roslibpy.Ros) -> None:
    topic = roslibpy.Topic(ros, "/teleop", "geometry_msgs/TwistStamped")
    topic.publish(roslibpy.Message({"twist": {"linear": {"x": 0.25}}}))
    (velocity,) = bridge.robot.received()
    assert isinstance(velocity, Velocity)
    assert (velocity.channel, velocity.twist) == (TeleopSource.TELEOP, Twist2(v_m_s=0.25))
    assert velocity.source.startswith("rosbridge-")


def test_roslibpy_calls_a_service(bridge: Bridge, ros: roslibpy.Ros) -> None:
    def answer(reply: dict[str, Any]) -> threading.Thread:
        def serve() -> None:
            (query,) = bridge.robot.received()
            assert isinstance(query, Query)
            query.reply({**reply, "asked": [query.name, dict(query.content)]})

        thread = threading.Thread(target=serve)
        thread.start()
        return thread

    service = roslibpy.Service(ros, "/command", "thumper_msgs/Command")
    thread = answer({"ok": True})
    answered = service.call(roslibpy.ServiceRequest({"command": "arm"}), timeout=20)
    assert answered["asked"] == ["command", {"command": "arm"}]
    thread.join()
    thread = answer({"ok": False, "error": "a fault is latched"})
    with pytest.raises(Exception, match="a fault is latched"):
        service.call(roslibpy.ServiceRequest({"command": "arm"}), timeout=20)
    thread.join()


def test_estop_does_not_wait_for_a_service_call(bridge: Bridge) -> None:
    requests: list[Request] = []

    def both_arrived() -> bool:
        requests.extend(bridge.robot.pending_requests())
        return {Query, EmergencyStop} <= set(map(type, requests))

    with connect(bridge.url) as socket:
        socket.send('{"op": "call_service", "service": "/command", "args": {"command": "cancel"}}')
        socket.send('{"op": "publish", "topic": "/estop", "msg": {"data": true}}')
        until(both_arrived)
        for request in requests:
            if isinstance(request, Query):
                request.reply({"ok": True, "text": "it stops"})
        assert json.loads(socket.recv(20))["values"]["text"] == "it stops"


def test_rosapi_lists_topics_and_types(ros: roslibpy.Ros) -> None:
    assert "/scan" in ros.get_topics()
    assert ros.get_topic_type("/map") == "nav_msgs/OccupancyGrid"


@pytest.mark.parametrize(
    ("sent", "reason"),
    [
        ("nonsense", "not valid JSON"),
        ("[]", "JSON object"),
        ('{"op": "exec", "cmd": "ls"}', "operation 'exec' is not supported"),
        ('{"op": "subscribe", "topic": "/etc/passwd"}', "no topic"),
        ('{"op": "subscribe", "topic": "/goal"}', "is only sent to the robot"),
        ('{"op": "subscribe", "topic": "/scan", "type": "nav_msgs/Path"}', "sensor_msgs/msg/LaserScan"),
        ('{"op": "subscribe", "topic": "/scan", "throttle_rate": -1}', "throttle_rate"),
        ('{"op": "publish", "topic": "/scan", "msg": {}}', "is published by the robot"),
        ('{"op": "publish", "topic": "/teleop", "msg": {"twist": 1}}', "twist"),
        ('{"op": "publish", "topic": "/teleop", "msg": {"speed": 1}}', "no field 'speed'"),
        (
            '{"op": "publish", "topic": "/teleop", "msg": {"twist": {"linear": {"x": "1"}}}}',
            "is not a number",
        ),
        ('{"op": "publish", "topic": "/estop", "msg": {"data": 1}}', "neither true nor false"),
        (
            '{"op": "publish", "topic": "/goal", "msg": {"header": {"stamp": {"sec": 0.5}}}}',
            "not fit in int32",
        ),
        (
            '{"op": "publish", "topic": "/goal", "msg": {"header": {"stamp": {"sec": 1e300}}}}',
            "not fit in int32",
        ),
        ('{"op": "publish", "topic": "/command", "msg": {"data": 1}}', "is not a string"),
    ],
)
def test_invalid_operations_are_answered_with_the_reason(bridge: Bridge, sent: str, reason: str) -> None:
    with connect(bridge.url) as socket:
        socket.send(sent)
        answer = json.loads(socket.recv(20))
    assert (answer["op"], answer["level"]) == ("status", "error")
    assert reason in answer["msg"]


def test_oversized_message_closes_only_its_connection(bridge: Bridge) -> None:
    with connect(bridge.url) as socket, connect(bridge.url) as other:
        socket.send("x" * 100_000)
        with pytest.raises(ConnectionClosed):
            socket.recv(20)
        other.send('{"op": "call_service", "service": "/rosapi/services", "id": "7"}')
        answer = json.loads(other.recv(20))
    assert answer["id"] == "7"
    assert "/command" in answer["values"]["services"]


def test_throttle_rate_limits_a_topic(bridge: Bridge) -> None:
    with connect(bridge.url) as socket:
        socket.send('{"op": "subscribe", "topic": "/cmd_vel", "throttle_rate": 60000}')
        for _ in range(50):
            bridge.robot.server.publish("cmd_vel", 0.0, M.twist(0.0, Twist2()))
            time.sleep(0.01)
        assert json.loads(socket.recv(20))["topic"] == "/cmd_vel"
        with pytest.raises(TimeoutError):
            socket.recv(0.3)


def test_messages_after_shutdown_are_ignored(bridge: Bridge) -> None:
    bridge.stop()
    # As from the bus's thread, which is still running.
    bridge.rosbridge._on_message(bridge.loop, "cmd_vel", M.twist(0.0, Twist2()))


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Origin": "http://localhost:3000"},  # another program's page on this computer
        {"Origin": "http://localhost:8080"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Authorization": "Bearer wrong horse !"},
        {"Authorization": f"Bearer {TOKEN}x"},
        {"Authorization": "Bearer "},
    ],
)
@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=wrong", "/?other=correct+horse"])
def test_nobody_connects_without_the_token(bridge: Bridge, headers: dict[str, str], path: str) -> None:
    url = f"ws://127.0.0.1:{bridge.port}{path}"
    with pytest.raises(InvalidStatus, match="401"), connect(url, additional_headers=headers):
        pass
    assert bridge.robot.pending_requests() == []


def test_topic_that_could_not_be_subscribed_is_tried_again(
    bridge: Bridge, ros: roslibpy.Ros, monkeypatch: pytest.MonkeyPatch
) -> None:
    subscribe, failures = bridge.bus.subscribe, ["once"]

    def fail_once(topic: str, callback: Callable[[Any], None]) -> None:
        if failures:
            raise ThumperError(failures.pop())
        subscribe(topic, callback)

    monkeypatch.setattr(bridge.bus, "subscribe", fail_once)
    roslibpy.Topic(ros, "/cmd_vel", "geometry_msgs/TwistStamped").subscribe(lambda _: None)
    until(lambda: not failures)
    received = receive_from(
        roslibpy.Topic(ros, "/cmd_vel", "geometry_msgs/TwistStamped"),
        lambda: bridge.robot.server.publish("cmd_vel", 0.0, M.twist(0.0, Twist2(v_m_s=0.5))),
    )
    assert received["twist"]["linear"]["x"] == 0.5


def test_public_address_requires_token_and_certificate() -> None:
    robot = Robot()
    try:
        with BusClient("r1", robot.address) as bus:
            with pytest.raises(ThumperError, match="token"):
                Rosbridge(bus, host="0.0.0.0", port=0, token="")
            with pytest.raises(ThumperError, match="certificate"):
                Rosbridge(bus, host="0.0.0.0", port=0, token=TOKEN)
    finally:
        robot.server.close()


def test_with_a_certificate_only_tls_connects(tmp_path: Path) -> None:
    certificate, key = tmp_path / "a.crt", tmp_path / "a.key"
    make_certificate(certificate, key, ["127.0.0.1"])
    bridge = Bridge(server_tls(certificate, key))
    try:
        trusted = ssl.create_default_context(cafile=str(certificate))
        url = bridge.url.replace("ws:", "wss:")
        with connect(url, ssl=trusted) as socket:
            socket.send('{"op": "call_service", "service": "/rosapi/services", "id": "1"}')
            assert "/mission/send" in json.loads(socket.recv(20.0))["values"]["services"]
        with pytest.raises((OSError, InvalidMessage)), connect(bridge.url):
            pass
    finally:
        bridge.close()


def test_invalid_certificate_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "a.crt", tmp_path / "a.key"):
        path.write_text("nothing")
    with pytest.raises(ThumperError, match="not a usable certificate"):
        server_tls(tmp_path / "a.crt", tmp_path / "a.key")
