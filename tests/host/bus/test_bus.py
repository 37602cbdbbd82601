"""Both ends of the bus, with a real Zenoh between them."""

import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.live import free_port, until
from thumper.bus import heartbeat_sender
from thumper.bus.client import BusClient
from thumper.bus.server import MOST_QUEUED, BusServer
from thumper.cli.status import watch
from thumper.common.errors import ThumperError
from thumper.common.geometry import Twist2
from thumper.config.bus import USUAL_ROBOT, BusOptions, is_loopback
from thumper.config.robot import RobotConfig
from thumper.maps.occupancy_grid import OccupancyGrid
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
    """The robot's end alone."""

    def __init__(self, token: str = "") -> None:
        self.address = f"127.0.0.1:{free_port()}"
        self.inbox = RequestQueue()
        self.told: list[str] = []
        options = BusOptions(address=self.address, token=token)
        self.server = BusServer("r1", options, self.inbox, self.told.append)

    def asked_now(self) -> list[Request]:
        return [request for _, request in self.inbox.take()]

    def asked(self) -> list[Request]:
        found: list[Request] = []

        def any_yet() -> bool:
            found.extend(self.asked_now())
            return bool(found)

        until(any_yet)
        return found


@pytest.fixture
def robot() -> Iterator[Robot]:
    robot = Robot()
    yield robot
    robot.server.close()


@pytest.fixture
def client(robot: Robot) -> Iterator[BusClient]:
    with BusClient("r1", robot.address) as client:
        yield client


def test_a_product_arrives_as_the_message_it_was(robot: Robot, client: BusClient) -> None:
    heard: list[Any] = []
    client.subscribe("cmd_vel", heard.append)

    def sent_and_heard() -> bool:
        robot.server.publish("cmd_vel", 0.0, M.twist(1.5, Twist2(v_m_s=0.25)))
        return bool(heard)

    until(sent_and_heard)
    assert heard[0].twist.linear.x == 0.25
    assert heard[0].header.stamp.nanosec == 500_000_000


def test_who_comes_late_still_gets_the_newest_map(robot: Robot, client: BusClient) -> None:
    robot.server.publish("map", 0.0, M.grid(0.0, GRID))
    until(lambda: robot.server.figures.sent == 1)
    heard: list[Any] = []
    client.subscribe("map", heard.append)
    assert (heard[0].info.width, heard[0].info.height) == (4, 3)
    assert heard[0].data.tolist() == list(range(12))


def test_a_command_comes_in_checked_and_with_its_sender(robot: Robot, client: BusClient) -> None:
    client.publish("gamepad", M.twist(0.0, Twist2(w_rad_s=0.5)))
    client.publish("teleop", M.twist(0.0, Twist2(v_m_s=0.1)), source="tab 3")
    asked: list[Request] = []
    while len(asked) < 2:
        asked += robot.asked()
    assert len(asked) == 2  # in either order: different topics
    assert Velocity(channel=TeleopSource.GAMEPAD, twist=Twist2(w_rad_s=0.5), source=client.source) in asked
    assert Velocity(channel=TeleopSource.TELEOP, twist=Twist2(v_m_s=0.1), source="tab 3") in asked


def test_what_makes_no_sense_is_counted_told_and_forgotten(robot: Robot, client: BusClient) -> None:
    client.publish("command", text("rm -rf /"))
    until(lambda: robot.server.figures.refused == 1)
    assert "no such command" in robot.told[0]
    client.publish_raw("goal", b"\x00\x01\x00\x00 nonsense")
    until(lambda: robot.server.figures.refused == 2)
    client.publish("estop", flag(True))
    assert robot.asked() == [EmergencyStop()]


def test_a_flood_is_refused_while_an_emergency_stop_passes(robot: Robot, client: BusClient) -> None:
    for _ in range(500):
        client.publish("command", text("arm"))
    client.publish("estop", flag(True))
    asked: list[Request] = []
    while EmergencyStop() not in asked:
        asked += robot.asked()
    until(lambda: robot.server.figures.refused > 400)
    assert len(asked) < 100


def test_a_question_is_answered_from_another_thread(robot: Robot, client: BusClient) -> None:
    def answer() -> None:
        (ask,) = robot.asked()
        assert isinstance(ask, Query)
        ask.reply({"ok": True, "values": {"kp": 1.0, **ask.content}})

    thread = threading.Thread(target=answer)
    thread.start()
    assert client.query("parameters/set", {"ki": 2.0})["values"] == {"kp": 1.0, "ki": 2.0}
    thread.join()
    with pytest.raises(ThumperError, match=r"does not answer any more; .*may still do") as caught:
        client.query("no such question")  # to which nobody answers
    assert caught.value.exit_code == 3
    robot.server.close()
    with pytest.raises(ThumperError, match="has left the bus: its program has ended") as caught:
        client.query("mission/state")
    assert caught.value.exit_code == 3


def test_a_refusal_is_told_in_words(robot: Robot, client: BusClient) -> None:
    with pytest.raises(ThumperError, match="no robot 'r1' answers"):
        client.query("shutdown")
    with pytest.raises(ThumperError, match="no robot 'r2' answers"), BusClient("r2", robot.address) as other:
        other.query("command", {"command": "arm"})


@pytest.mark.parametrize(("talked", "words"), [(True, "says nothing any more"), (False, "its name")])
def test_who_watches_a_robot_that_is_gone_is_told(
    robot: Robot, monkeypatch: pytest.MonkeyPatch, *, talked: bool, words: str
) -> None:
    monkeypatch.setattr(heartbeat_sender, "SILENCE_S", 0.2)
    if talked:
        robot.server.publish("status", 0.0, M.status(Status(time_s=0.0)))
        until(lambda: robot.server.figures.sent == 1)
    with pytest.raises(ThumperError, match=words) as caught:
        watch("events", bus=robot.address, robot="r1")
    assert caught.value.exit_code == 3


def test_who_watches_an_idle_robot_is_told_that_it_is_there(
    robot: Robot, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(heartbeat_sender, "SILENCE_S", 0.2)
    robot.server.publish("status", 0.0, M.status(Status(time_s=0.0)))
    until(lambda: robot.server.figures.sent == 1)
    with pytest.raises(ThumperError, match="says nothing any more"):
        watch("events", bus=robot.address, robot="r1")
    assert capsys.readouterr() == (
        "",
        "thumper: robot 'r1' is running; no messages on events yet (Ctrl-C to stop)\n",
    )


def test_a_robot_that_says_nothing_of_the_topic_is_not_gone(
    robot: Robot, client: BusClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock_s = [10.0]
    monkeypatch.setattr(heartbeat_sender, "time", SimpleNamespace(monotonic=lambda: clock_s[0]))
    alive = heartbeat_sender.HeartbeatSender(client)
    clock_s[0] += 0.9 * heartbeat_sender.SILENCE_S
    robot.server.publish("status", 0.0, M.status(Status(time_s=0.0)))
    until(lambda: alive.has_talked)
    clock_s[0] += 0.9 * heartbeat_sender.SILENCE_S
    alive.check()
    clock_s[0] += 0.2 * heartbeat_sender.SILENCE_S
    with pytest.raises(ThumperError, match="'r1' says nothing any more"):
        alive.check()


def test_without_the_token_nobody_joins() -> None:
    robot = Robot(token=TOKEN)
    try:
        for token in ("", "wrong horse !"):
            with pytest.raises(ThumperError, match="token"):
                BusClient("r1", robot.address, token)
        with BusClient("r1", robot.address, TOKEN) as client:
            client.publish("estop", flag(True))
            assert robot.asked() == [EmergencyStop()]
    finally:
        robot.server.close()


def test_nothing_listens_beyond_this_machine(robot: Robot) -> None:
    """Every listening TCP socket of this process, and every bound UDP one, is on a loopback address."""
    links = [os.readlink(path) for path in Path("/proc/self/fd").iterdir() if path.is_symlink()]
    mine = {link[len("socket:[") : -1] for link in links if link.startswith("socket:[")}
    found = []
    for table, listens in (("tcp", "0A"), ("tcp6", "0A"), ("udp", "07"), ("udp6", "07")):
        for line in Path(f"/proc/self/net/{table}").read_text(encoding="ascii").splitlines()[1:]:
            cells = line.split()
            if cells[9] in mine and cells[3] == listens:
                found.append(cells[1].split(":")[0])
    assert found
    assert set(found) <= {"0100007F"}  # 127.0.0.1


def test_no_robot_there() -> None:
    with pytest.raises(ThumperError, match=r"no robot is running at 127\.0\.0\.1:") as caught:
        BusClient("r1", f"127.0.0.1:{free_port()}")
    assert caught.value.exit_code == 3


def test_an_address_that_is_taken(robot: Robot) -> None:
    with pytest.raises(ThumperError, match="another robot's process"):
        BusServer("r2", BusOptions(address=robot.address), RequestQueue(), print)


def test_a_bus_that_cannot_keep_up_drops_the_oldest_and_never_waits(robot: Robot) -> None:
    begun, release = threading.Event(), threading.Event()

    def stand_still() -> None:
        begun.set()
        release.wait(20.0)

    robot.server._enqueue(stand_still)
    begun.wait(20.0)
    for n in range(3 * MOST_QUEUED):
        robot.server.publish("cmd_vel", 0.0, M.twist(float(n), Twist2()))
    assert not release.is_set()  # all were taken although nothing could be sent
    assert robot.server.figures.dropped == 2 * MOST_QUEUED
    release.set()
    until(lambda: robot.server.figures.sent >= MOST_QUEUED)


@pytest.mark.parametrize(
    ("address", "token", "why"),
    [
        ("0.0.0.0:7447", "", "set a token"),
        ("192.168.1.5:7447", "", "set a token"),
        ("robot.local:7447", "", "set a token"),
        ("127.0.0.1:7447", "short", "12 characters"),
        ("127.0.0.1:7447", "with:a colon in it", "no colon"),
        ("127.0.0.1", "", "no address"),
        ("127.0.0.1:0", "", "no address"),
        (":7447", "", "no address"),
    ],
)
def test_options_that_are_refused(address: str, token: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        BusOptions(address=address, token=token)


def test_options_that_pass() -> None:
    assert BusOptions().address == "127.0.0.1:7447"
    assert RobotConfig().name == USUAL_ROBOT
    assert BusOptions(address="0.0.0.0:7447", token=TOKEN).token == TOKEN
    assert BusOptions().at("[::1]:7448").address == "[::1]:7448"
    with pytest.raises(ThumperError, match="set a token"):
        BusOptions().at("10.0.0.1:7447")
    assert is_loopback("127.3.2.1")
    assert not is_loopback("128.0.0.1")


def test_a_client_that_was_closed_on_another_thread_says_so(robot: Robot) -> None:
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
