"""Server and client of the bus, over a real Zenoh session."""

import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from benchmarks.shared.live import free_port, until

from tests.allocated import kept_bytes
from thumper.bus import status_watchdog
from thumper.bus.client import BusClient
from thumper.bus.server import MAX_QUEUED, BusServer
from thumper.bus.subscription import Subscription
from thumper.cli import status
from thumper.cli.status import watch
from thumper.common.errors import ThumperError
from thumper.common.geometry import Twist2
from thumper.config.bus import DEFAULT_ROBOT, BusOptions, is_loopback
from thumper.config.robot import RobotConfig
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.ros.codec import encode
from thumper.ros.status import Status
from thumper.ros.to_ros import Messages, flag, text
from thumper.runtime.requests import EmergencyStop, Query, Request, TeleopSource, Velocity
from thumper.runtime.service.request_queue import RequestQueue

M = Messages()
GRID = OccupancyGrid(
    cells=np.arange(12, dtype=np.int8).reshape(3, 4), resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0
)
TOKEN = "correct horse"


class Robot:
    """The robot's end of the bus without a robot."""

    def __init__(self, token: str = "", tls: str = "") -> None:
        self.address = f"127.0.0.1:{free_port()}"
        self.requests = RequestQueue()
        self.reported: list[str] = []
        options = BusOptions(address=self.address, token=token, tls=tls)
        self.server = BusServer("r1", options, self.requests, self.reported.append)

    def pending_requests(self) -> list[Request]:
        return [request for _, request in self.requests.take_all()]

    def received(self) -> list[Request]:
        requests: list[Request] = []

        def has_received() -> bool:
            requests.extend(self.pending_requests())
            return bool(requests)

        until(has_received)
        return requests


@pytest.fixture
def robot() -> Iterator[Robot]:
    robot = Robot()
    yield robot
    robot.server.close()


@pytest.fixture
def client(robot: Robot) -> Iterator[BusClient]:
    with BusClient("r1", robot.address) as client:
        yield client


def test_published_message_arrives_unchanged(robot: Robot, client: BusClient) -> None:
    received: list[Any] = []
    client.subscribe("cmd_vel", received.append)

    def is_received() -> bool:
        robot.server.publish("cmd_vel", 0.0, M.twist(1.5, Twist2(v_m_s=0.25)))
        return bool(received)

    until(is_received)
    assert received[0].twist.linear.x == 0.25
    assert received[0].header.stamp.nanosec == 500_000_000


def test_late_subscriber_receives_newest_map(robot: Robot, client: BusClient) -> None:
    robot.server.publish("map", 0.0, M.grid(0.0, GRID))
    until(lambda: robot.server.statistics.sent == 1)
    received: list[Any] = []
    client.subscribe("map", received.append)
    assert (received[0].info.width, received[0].info.height) == (4, 3)
    assert received[0].data.tolist() == list(range(12))


def test_velocity_arrives_with_its_source(robot: Robot, client: BusClient) -> None:
    client.publish("gamepad", M.twist(0.0, Twist2(w_rad_s=0.5)))
    client.publish("teleop", M.twist(0.0, Twist2(v_m_s=0.1)), source="tab 3")
    requests: list[Request] = []
    while len(requests) < 2:
        requests += robot.received()
    assert len(requests) == 2  # in any order: different topics
    assert Velocity(channel=TeleopSource.GAMEPAD, twist=Twist2(w_rad_s=0.5), source=client.source) in requests
    assert Velocity(channel=TeleopSource.TELEOP, twist=Twist2(v_m_s=0.1), source="tab 3") in requests


def test_invalid_messages_are_counted_reported_and_dropped(robot: Robot, client: BusClient) -> None:
    client.publish("command", text("rm -rf /"))
    until(lambda: robot.server.statistics.refused == 1)
    assert "no such command" in robot.reported[0]
    client.publish_raw("goal", b"\x00\x01\x00\x00 nonsense")
    until(lambda: robot.server.statistics.refused == 2)
    client.publish("estop", flag(True))
    assert robot.received() == [EmergencyStop()]


def test_emergency_stop_passes_during_a_flood(robot: Robot, client: BusClient) -> None:
    for _ in range(500):
        client.publish("command", text("arm"))
    client.publish("estop", flag(True))
    requests: list[Request] = []
    while EmergencyStop() not in requests:
        requests += robot.received()
    until(lambda: robot.server.statistics.refused > 400)
    assert len(requests) < 100


def test_query_is_answered_from_another_thread(robot: Robot, client: BusClient) -> None:
    def answer() -> None:
        (query,) = robot.received()
        assert isinstance(query, Query)
        query.reply({"ok": True, "values": {"kp": 1.0, **query.content}})

    thread = threading.Thread(target=answer)
    thread.start()
    assert client.query("parameters/set", {"ki": 2.0})["values"] == {"kp": 1.0, "ki": 2.0}
    thread.join()
    with pytest.raises(ThumperError, match=r"no longer answers; it may still be driving") as caught:
        client.query("no such service")  # no answer
    assert caught.value.exit_code == 3
    robot.server.close()
    with pytest.raises(ThumperError, match="has left the bus: its program has ended") as caught:
        client.query("mission/state")
    assert caught.value.exit_code == 3


def test_query_without_an_answer_raises(robot: Robot, client: BusClient) -> None:
    with pytest.raises(ThumperError, match="no robot 'r1' answers"):
        client.query("shutdown")
    with pytest.raises(ThumperError, match="no robot 'r2' answers"), BusClient("r2", robot.address) as other:
        other.query("command", {"command": "arm"})


def test_watch_exits_if_the_robot_never_publishes(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(status_watchdog, "STATUS_TIMEOUT_S", 0.2)
    with pytest.raises(ThumperError, match="its name") as caught:
        watch("events", bus=robot.address, robot="r1")
    assert caught.value.exit_code == 3


def test_watch_reports_a_robot_without_messages_on_the_topic(
    robot: Robot, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(status_watchdog, "STATUS_TIMEOUT_S", 0.2)
    monkeypatch.setattr(status, "POLL_PERIOD_S", 0.3)
    robot.server.publish("status", 0.0, M.status(Status(time_s=0.0)))
    until(lambda: robot.server.statistics.sent == 1)

    def publish_later() -> None:
        time.sleep(2.0)
        robot.server.publish("events", 0.0, M.event(0.0, 20, "at last"))

    thread = threading.Thread(target=publish_later)
    thread.start()
    watch("events", bus=robot.address, robot="r1", count=1)
    thread.join()
    lines = capsys.readouterr().err.splitlines()
    assert re.fullmatch(
        r"\d\d:\d\d:\d\d thumper: robot 'r1' is running; no messages on events yet \(Ctrl-C to stop\)",
        lines[0],
    )
    assert "thumper: robot 'r1' has stopped publishing" in lines[1]
    assert len(lines) == 2


def test_status_watchdog_needs_only_the_status(
    robot: Robot, client: BusClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock_s = [10.0]
    monkeypatch.setattr(status_watchdog, "time", SimpleNamespace(monotonic=lambda: clock_s[0]))
    watchdog = status_watchdog.StatusWatchdog(client)
    clock_s[0] += 0.9 * status_watchdog.STATUS_TIMEOUT_S
    robot.server.publish("status", 0.0, M.status(Status(time_s=0.0)))
    until(lambda: watchdog.has_received)
    clock_s[0] += 0.9 * status_watchdog.STATUS_TIMEOUT_S
    watchdog.check()
    clock_s[0] += 0.2 * status_watchdog.STATUS_TIMEOUT_S
    with pytest.raises(ThumperError, match="'r1' has stopped publishing"):
        watchdog.check()


def test_client_without_the_token_is_refused() -> None:
    robot = Robot(token=TOKEN)
    try:
        for token in ("", "wrong horse !"):
            with pytest.raises(ThumperError, match="token"):
                BusClient("r1", robot.address, token)
        with BusClient("r1", robot.address, TOKEN) as client:
            client.publish("estop", flag(True))
            assert robot.received() == [EmergencyStop()]
    finally:
        robot.server.close()


def test_all_sockets_are_on_loopback(robot: Robot) -> None:
    """Every listening TCP socket and every bound UDP socket of this process has a loopback address."""
    links = [os.readlink(path) for path in Path("/proc/self/fd").iterdir() if path.is_symlink()]
    own = {link[len("socket:[") : -1] for link in links if link.startswith("socket:[")}
    addresses = []
    for table, listens in (("tcp", "0A"), ("tcp6", "0A"), ("udp", "07"), ("udp6", "07")):
        for line in Path(f"/proc/self/net/{table}").read_text(encoding="ascii").splitlines()[1:]:
            cells = line.split()
            if cells[9] in own and cells[3] == listens:
                addresses.append(cells[1].split(":")[0])
    assert addresses
    assert set(addresses) <= {"0100007F"}  # 127.0.0.1


def test_connecting_without_a_robot_raises() -> None:
    with pytest.raises(ThumperError, match=r"no robot is running at 127\.0\.0\.1:") as caught:
        BusClient("r1", f"127.0.0.1:{free_port()}")
    assert caught.value.exit_code == 3


def test_address_in_use_is_refused(robot: Robot) -> None:
    with pytest.raises(ThumperError, match="another robot process"):
        BusServer("r2", BusOptions(address=robot.address), RequestQueue(), print)


def test_slow_bus_drops_the_oldest_messages(robot: Robot) -> None:
    started, release = threading.Event(), threading.Event()

    def block() -> None:
        started.set()
        release.wait(20.0)

    robot.server._enqueue(block)
    started.wait(20.0)
    for n in range(3 * MAX_QUEUED):
        robot.server.publish("cmd_vel", 0.0, M.twist(float(n), Twist2()))
    assert not release.is_set()  # publish returned although nothing could be sent
    assert robot.server.statistics.dropped == 2 * MAX_QUEUED
    assert not robot.reported
    release.set()
    until(lambda: robot.server.statistics.sent >= MAX_QUEUED)
    assert robot.reported == [f"{2 * MAX_QUEUED} messages did not reach the bus: it is too slow"]


@pytest.mark.parametrize(
    ("address", "token", "reason"),
    [
        ("0.0.0.0:7448", "", "set a token"),
        ("192.168.1.5:7448", "", "set a token"),
        ("robot.local:7448", "", "set a token"),
        ("127.0.0.1:7448", "short", "12 characters"),
        ("127.0.0.1:7448", "with:a colon in it", "must not contain a colon"),
        ("127.0.0.1", "", "is not an address"),
        ("127.0.0.1:0", "", "is not an address"),
        (":7448", "", "is not an address"),
    ],
)
def test_invalid_bus_options_are_refused(address: str, token: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        BusOptions(address=address, token=token)


def test_valid_bus_options_are_accepted() -> None:
    assert BusOptions().address == "127.0.0.1:7448"
    assert RobotConfig().name == DEFAULT_ROBOT
    assert BusOptions(address="0.0.0.0:7448", token=TOKEN).token == TOKEN
    assert BusOptions().at("[::1]:7448").address == "[::1]:7448"
    with pytest.raises(ThumperError, match="set a token"):
        BusOptions().at("10.0.0.1:7448")
    assert is_loopback("127.3.2.1")
    assert not is_loopback("128.0.0.1")


def test_closed_client_raises(robot: Robot) -> None:
    client = BusClient("r1", robot.address)
    client.close()
    uses: tuple[Callable[[], Any], ...] = (
        lambda: client.query("mission/state"),
        lambda: client.publish("estop", flag(True)),
        lambda: client.subscribe("map", lambda _: None),
        lambda: client.subscribe_raw("scan", lambda _: None),
    )
    for use in uses:
        with pytest.raises(ThumperError, match="closed"):
            use()


def test_client_waits_for_the_robot_and_follows_its_restart() -> None:
    address = f"127.0.0.1:{free_port()}"
    received: list[str] = []
    client = BusClient("r1", address, wait=True)
    with pytest.raises(ThumperError, match="no robot"):
        client.query("mission/state", {})
    client.publish("estop", flag(True), source="me")  # dropped
    client.subscribe("status", lambda message: received.append(message.mode))
    try:
        for mode in ("first", "second"):
            server = BusServer("r1", BusOptions(address=address), RequestQueue(), print)

            def is_received(server: BusServer = server, mode: str = mode) -> bool:
                server.publish("status", 0.0, M.status(Status(time_s=0.0, mode=mode)))
                return mode in received

            until(is_received)
            server.close()
    finally:
        client.close()


def server_with_message(address: str, topic: str, data: str) -> BusServer:
    server = BusServer("r1", BusOptions(address=address), RequestQueue(), print)
    server.publish(topic, 0.0, text(data))
    until(lambda: server.statistics.sent == 1)
    return server


def test_client_fetches_latched_messages_of_a_restarted_robot() -> None:
    address = f"127.0.0.1:{free_port()}"
    losses: list[bool] = []
    runs: list[str] = []
    server = server_with_message(address, "session", "run 1")
    with BusClient("r1", address) as client:
        client.on_lost(lambda: losses.append(True))
        client.subscribe("session", lambda message: runs.append(message.data))
        assert runs == ["run 1"]
        server.close()
        until(lambda: losses)
        server = BusServer("r1", BusOptions(address=address), RequestQueue(), print)
        server.publish("session", 0.0, text("run 2"))  # once, before the client is back
        until(lambda: len(runs) == 2)
        assert runs == ["run 1", "run 2"]
        client.publish("estop", flag(True))
        assert losses == [True]
        server.close()


def test_program_that_fails_ends() -> None:
    program = f"""
from thumper.bus.client import BusClient
from thumper.bus.server import BusServer
from thumper.config.bus import BusOptions
from thumper.runtime.service.request_queue import RequestQueue

server = BusServer("r1", BusOptions(address="127.0.0.1:{(port := free_port())}"), RequestQueue(), print)
client = BusClient("r1", "127.0.0.1:{port}")
client.subscribe("session", print)
raise SystemExit(3)
"""
    assert subprocess.run([sys.executable, "-c", program], timeout=60.0, check=False).returncode == 3


def test_message_that_is_fetched_and_sent_comes_once(robot: Robot) -> None:
    """A restarted robot sends a message while a client fetches it: the message comes both ways."""
    runs: list[str] = []
    robot.server.publish("session", 0.0, text("run 1"))
    until(lambda: robot.server.statistics.sent == 1)
    with BusClient("r1", robot.address) as client:
        client.subscribe("session", lambda message: runs.append(message.data))
        until(lambda: runs)
        publisher = robot.server._publishers["session"]
        until(lambda: publisher.matching_status.matching)  # type: ignore[attr-defined]  # the stub says bool
        for name in ("run 1", "run 2", "run 1"):
            robot.server.publish("session", 0.0, text(name))
        until(lambda: len(runs) > 2)
        assert runs == ["run 1", "run 2", "run 1"]


def test_equal_message_of_a_restarted_robot_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy computer its answer is late: the message arrives by subscription first."""
    address = f"127.0.0.1:{free_port()}"
    fetch = Subscription.fetch
    losses: list[bool] = []
    maps: list[str] = []
    server = server_with_message(address, "annotations", "zones")
    with BusClient("r1", address) as client:
        client.on_lost(lambda: losses.append(True))
        client.subscribe("annotations", lambda message: maps.append(message.data))
        until(lambda: maps)
        returned = threading.Event()

        def fetch_late(self: Subscription, session: Any) -> None:
            returned.set()
            until(lambda: len(maps) > 1, timeout_s=5.0)
            fetch(self, session)

        monkeypatch.setattr(Subscription, "fetch", fetch_late)
        server.close()
        until(lambda: losses)
        server = BusServer("r1", BusOptions(address=address), RequestQueue(), print)
        until(returned.is_set)
        server.publish("annotations", 0.0, text("zones"))
        until(lambda: len(maps) > 1, timeout_s=5.0)
    assert maps == ["zones", "zones"]
    server.close()


def test_late_answer_never_follows_newer_messages(monkeypatch: pytest.MonkeyPatch) -> None:
    """The newest status is fetched while newer ones arrive; on a busy computer the answer comes last."""

    def reply_late(self: BusServer, query: Any) -> None:
        raw = encode(self._newest[str(query.key_expr).removeprefix(self._prefix)])
        threading.Timer(0.5, lambda: (query.reply(query.key_expr, raw), query.drop())).start()

    monkeypatch.setattr(BusServer, "_reply_newest", reply_late)
    robot = Robot()
    times_s: list[float] = []
    stop = threading.Event()

    def publish() -> None:
        for n in range(1000):
            robot.server.publish("status", 0.0, M.status(Status(time_s=float(n))))
            if stop.wait(0.02):
                return

    thread = threading.Thread(target=publish)
    thread.start()
    until(lambda: robot.server.statistics.sent > 5)
    with BusClient("r1", robot.address) as client:
        client.subscribe("status", lambda message: times_s.append(message.header.stamp.sec))
        until(lambda: len(times_s) > 30)
    stop.set()
    thread.join()
    robot.server.close()
    assert times_s == sorted(times_s)


def test_status_watchdog_reports_loss_and_return(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(status_watchdog, "STATUS_TIMEOUT_S", 0.2)
    lines: list[str] = []
    client = BusClient("r1", robot.address)
    watchdog = status_watchdog.StatusWatchdog(client, lines.append)
    robot.server.publish("status", 0.0, M.status(Status(time_s=0.0)))
    until(lambda: watchdog.has_received)

    def has_reported(count: int) -> bool:
        watchdog.check()
        return len(lines) == count

    until(lambda: has_reported(1))
    robot.server.publish("status", 0.0, M.status(Status(time_s=1.0)))
    until(lambda: has_reported(2))
    client.close()
    assert "has stopped publishing" in lines[0]
    assert "waiting for it to return" in lines[0]
    assert lines[1] == "robot 'r1' is back"


def test_a_closed_server_keeps_no_memory() -> None:
    """Zenoh never frees what is undeclared after its session is closed: 55 kB for each server."""

    def open_and_close() -> None:
        Robot().server.close()

    assert kept_bytes(open_and_close, warm_up=5, repeats=9) < 10_000
