"""The rosbridge server with a real client, roslibpy, and a real Zenoh bus behind it."""

import asyncio
import json
import ssl
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import roslibpy
from websockets.exceptions import ConnectionClosed, InvalidMessage, InvalidStatus
from websockets.sync.client import connect

from tests.host.bus.test_bus import GRID, TOKEN, M, Robot
from tests.live import until
from thumper.bus.client import BusClient
from thumper.bus.rosbridge import Rosbridge
from thumper.common.errors import ThumperError
from thumper.common.geometry import Twist2
from thumper.dashboard.certificate import make_certificate, server_tls
from thumper.lidar.scan import Scan
from thumper.runtime.requests import EmergencyStop, Query, Request, TeleopSource, Velocity


class Bridge:
    """A robot's end of the bus, and a rosbridge in a thread of its own."""

    def __init__(self, token: str = "", tls: ssl.SSLContext | None = None) -> None:
        self.robot = Robot(token)
        self.bus = BusClient("r1", self.robot.address, token)
        self.rosbridge = Rosbridge(self.bus, host="127.0.0.1", port=0, token=token, tls=tls)
        ready = threading.Event()

        def serve() -> None:
            self._loop = asyncio.new_event_loop()

            def note(port: int) -> None:
                self.port = port
                ready.set()

            self._task = self._loop.create_task(self.rosbridge.serve(note))
            with suppress(asyncio.CancelledError):
                self._loop.run_until_complete(self._task)

        self._thread = threading.Thread(target=serve)
        self._thread.start()
        assert ready.wait(20.0)

    @property
    def url(self) -> str:
        return f"ws://127.0.0.1:{self.port}"

    def end(self) -> None:
        self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join(20.0)
        self._loop.close()

    def close(self) -> None:
        if not self._loop.is_closed():
            self.end()
        self.bus.close()
        self.robot.server.close()


@pytest.fixture
def bridge() -> Iterator[Bridge]:
    bridge = Bridge()
    yield bridge
    bridge.close()


@pytest.fixture
def ros(bridge: Bridge) -> Iterator[roslibpy.Ros]:
    ros = roslibpy.Ros("127.0.0.1", bridge.port)
    ros.run(timeout=20)
    yield ros
    ros.close()


def heard_from(topic: roslibpy.Topic, publish: Callable[[], None]) -> Any:
    heard: list[Any] = []
    topic.subscribe(heard.append)

    def sent_and_heard() -> bool:
        publish()
        return bool(heard)

    until(sent_and_heard)
    return heard[0]


def test_a_scan_reaches_roslibpy(bridge: Bridge, ros: roslibpy.Ros) -> None:
    ranges_m = np.array([1.0, np.nan, np.inf])
    scan = Scan(time_s=1.5, ranges_m=ranges_m, angle_min_rad=-1.0, angle_increment_rad=1.0)
    heard = heard_from(
        roslibpy.Topic(ros, "/scan", "sensor_msgs/LaserScan"),
        lambda: bridge.robot.server.publish("scan", 1.5, M.scan(scan)),
    )
    assert heard["ranges"] == [1.0, None, None]
    assert heard["header"] == {"stamp": {"sec": 1, "nanosec": 500_000_000}, "frame_id": "laser"}


def test_who_comes_late_still_gets_the_map(bridge: Bridge, ros: roslibpy.Ros) -> None:
    bridge.robot.server.publish("map", 0.0, M.grid(0.0, GRID))
    until(lambda: bridge.robot.server.figures.sent == 1)
    for _ in range(2):  # the second one comes when the bridge has it already
        heard = heard_from(roslibpy.Topic(ros, "/map", "nav_msgs/OccupancyGrid"), lambda: None)
        assert heard["data"] == list(range(12))


def test_roslibpy_drives(bridge: Bridge, ros: roslibpy.Ros) -> None:
    topic = roslibpy.Topic(ros, "/teleop", "geometry_msgs/TwistStamped")
    topic.publish(roslibpy.Message({"twist": {"linear": {"x": 0.25}}}))
    (asked,) = bridge.robot.asked()
    assert isinstance(asked, Velocity)
    assert (asked.channel, asked.twist) == (TeleopSource.TELEOP, Twist2(v_m_s=0.25))
    assert asked.source.startswith("rosbridge-")


def test_a_service_is_a_question_to_the_robot(bridge: Bridge, ros: roslibpy.Ros) -> None:
    def answer(reply: dict[str, Any]) -> threading.Thread:
        def serve() -> None:
            (ask,) = bridge.robot.asked()
            assert isinstance(ask, Query)
            ask.reply({**reply, "asked": [ask.name, dict(ask.content)]})

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


def test_a_stop_does_not_wait_for_the_answer_to_a_question(bridge: Bridge) -> None:
    asked: list[Request] = []

    def both_came() -> bool:
        asked.extend(bridge.robot.asked_now())
        return {Query, EmergencyStop} <= set(map(type, asked))

    with connect(bridge.url) as socket:
        socket.send('{"op": "call_service", "service": "/command", "args": {"command": "cancel"}}')
        socket.send('{"op": "publish", "topic": "/estop", "msg": {"data": true}}')
        until(both_came)
        for request in asked:
            if isinstance(request, Query):
                request.reply({"ok": True, "text": "it stops"})
        assert json.loads(socket.recv(20))["values"]["text"] == "it stops"


def test_it_says_what_there_is(ros: roslibpy.Ros) -> None:
    assert "/scan" in ros.get_topics()
    assert ros.get_topic_type("/map") == "nav_msgs/OccupancyGrid"


@pytest.mark.parametrize(
    ("sent", "why"),
    [
        ("nonsense", "no JSON"),
        ("[]", "JSON object"),
        ('{"op": "exec", "cmd": "ls"}', "no operation 'exec'"),
        ('{"op": "subscribe", "topic": "/etc/passwd"}', "no topic"),
        ('{"op": "subscribe", "topic": "/goal"}', "only goes to the robot"),
        ('{"op": "subscribe", "topic": "/scan", "type": "nav_msgs/Path"}', "sensor_msgs/msg/LaserScan"),
        ('{"op": "subscribe", "topic": "/scan", "throttle_rate": -1}', "throttle_rate"),
        ('{"op": "publish", "topic": "/scan", "msg": {}}', "is published by the robot"),
        ('{"op": "publish", "topic": "/teleop", "msg": {"twist": 1}}', "twist"),
        ('{"op": "publish", "topic": "/teleop", "msg": {"speed": 1}}', "no 'speed'"),
        ('{"op": "publish", "topic": "/teleop", "msg": {"twist": {"linear": {"x": "1"}}}}', "no number"),
        ('{"op": "publish", "topic": "/estop", "msg": {"data": 1}}', "neither true nor false"),
        ('{"op": "publish", "topic": "/goal", "msg": {"header": {"stamp": {"sec": 0.5}}}}', "no int32"),
        ('{"op": "publish", "topic": "/goal", "msg": {"header": {"stamp": {"sec": 1e300}}}}', "no int32"),
        ('{"op": "publish", "topic": "/command", "msg": {"data": 1}}', "no text"),
    ],
)
def test_what_makes_no_sense_is_answered_with_why(bridge: Bridge, sent: str, why: str) -> None:
    with connect(bridge.url) as socket:
        socket.send(sent)
        answer = json.loads(socket.recv(20))
    assert (answer["op"], answer["level"]) == ("status", "error")
    assert why in answer["msg"]


def test_too_much_at_once_ends_the_connection_alone(bridge: Bridge) -> None:
    with connect(bridge.url) as socket, connect(bridge.url) as other:
        socket.send("x" * 100_000)
        with pytest.raises(ConnectionClosed):
            socket.recv(20)
        other.send('{"op": "call_service", "service": "/rosapi/services", "id": "7"}')
        answer = json.loads(other.recv(20))
    assert answer["id"] == "7"
    assert "/command" in answer["values"]["services"]


def test_throttled_topics_come_less_often(bridge: Bridge) -> None:
    with connect(bridge.url) as socket:
        socket.send('{"op": "subscribe", "topic": "/cmd_vel", "throttle_rate": 60000}')
        for _ in range(50):
            bridge.robot.server.publish("cmd_vel", 0.0, M.twist(0.0, Twist2()))
            time.sleep(0.01)
        assert json.loads(socket.recv(20))["topic"] == "/cmd_vel"
        with pytest.raises(TimeoutError):
            socket.recv(0.3)


def test_what_the_bus_says_after_the_end_goes_nowhere(bridge: Bridge) -> None:
    bridge.end()
    bridge.rosbridge._take("cmd_vel", M.twist(0.0, Twist2()))  # on the bus's thread, which goes on


@pytest.mark.parametrize("origin", ["http://evil.example", "https://127.0.0.1.evil.example", "null"])
def test_a_foreign_page_is_not_let_in(bridge: Bridge, origin: str) -> None:
    with (
        pytest.raises(InvalidStatus, match="403"),
        connect(bridge.url, additional_headers={"Origin": origin}),
    ):
        pass
    with connect(bridge.url, additional_headers={"Origin": "http://localhost:8080"}) as socket:
        socket.ping()


def test_with_a_token_nobody_is_let_in_without_it() -> None:
    bridge = Bridge(TOKEN)
    try:
        for headers in ({}, {"Authorization": "Bearer wrong horse !"}):
            with pytest.raises(InvalidStatus, match="401"), connect(bridge.url, additional_headers=headers):
                pass
        ros = roslibpy.Ros("127.0.0.1", bridge.port, headers={"Authorization": f"Bearer {TOKEN}"})
        ros.run(timeout=20)
        assert "/scan" in ros.get_topics()
        ros.close()
    finally:
        bridge.close()


def test_beyond_this_machine_only_with_a_token_and_a_certificate() -> None:
    robot = Robot()
    try:
        with BusClient("r1", robot.address) as bus:
            with pytest.raises(ThumperError, match="token"):
                Rosbridge(bus, host="0.0.0.0", port=0, token="")
            with pytest.raises(ThumperError, match="certificate"):
                Rosbridge(bus, host="0.0.0.0", port=0, token=TOKEN)
    finally:
        robot.server.close()


def test_with_a_certificate_the_token_does_not_cross_the_network_in_clear(tmp_path: Path) -> None:
    certificate, key = tmp_path / "a.crt", tmp_path / "a.key"
    make_certificate(certificate, key, ["127.0.0.1"])
    headers = {"Authorization": f"Bearer {TOKEN}"}
    bridge = Bridge(TOKEN, server_tls(certificate, key))
    try:
        trusted = ssl.create_default_context(cafile=str(certificate))
        url = bridge.url.replace("ws:", "wss:")
        with connect(url, additional_headers=headers, ssl=trusted) as socket:
            socket.send('{"op": "call_service", "service": "/rosapi/services", "id": "1"}')
            assert "/mission/send" in json.loads(socket.recv(20.0))["values"]["services"]
        with pytest.raises((OSError, InvalidMessage)), connect(bridge.url, additional_headers=headers):
            pass
    finally:
        bridge.close()


def test_files_that_are_no_certificate_are_told(tmp_path: Path) -> None:
    for path in (tmp_path / "a.crt", tmp_path / "a.key"):
        path.write_text("nothing")
    with pytest.raises(ThumperError, match="they cannot be used"):
        server_tls(tmp_path / "a.crt", tmp_path / "a.key")
