"""Who may do what on the bus: encryption between computers, and no client that poses as the robot."""

import json
import re
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import zenoh
from benchmarks.shared.live import free_port, until

from tests.host.bus.test_bus import TOKEN, M, Robot
from thumper.bus import keys as bus_keys
from thumper.bus.client import BusClient
from thumper.bus.keys import make_keys
from thumper.bus.server import BusServer
from thumper.bus.zenoh_session import open_client
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.config.bus import BusOptions, split_address
from thumper.ros.codec import encode
from thumper.ros.to_ros import flag
from thumper.runtime.requests import EmergencyStop
from thumper.runtime.service.request_queue import RequestQueue


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys")
    make_keys(folder)
    return folder


@pytest.fixture
def encrypted(keys: Path) -> Iterator[Robot]:
    robot = Robot(TOKEN, tls=str(keys))
    yield robot
    robot.server.close()


def test_client_with_the_keys_and_the_token_connects(encrypted: Robot, keys: Path) -> None:
    with BusClient("r1", encrypted.address, TOKEN, tls=str(keys)) as client:
        poses: list[Any] = []
        client.subscribe("pose", poses.append)
        client.publish("estop", flag(True))
        assert encrypted.received() == [EmergencyStop()]

        def has_pose() -> bool:
            encrypted.server.publish("pose", 0.0, M.pose(0.0, Pose2(x_m=1.0)))
            return bool(poses)

        until(has_pose)


def test_silent_connections_keep_no_client_out() -> None:
    """A client that connects afterwards may have to stop the robot."""
    robot = Robot()
    host, port = split_address(robot.address)
    with ExitStack() as stack:
        stack.callback(robot.server.close)
        for _ in range(150):
            stack.enter_context(socket.create_connection((host, port), 5.0))
        client = stack.enter_context(BusClient("r1", robot.address))
        client.publish("estop", flag(True))
        assert robot.received() == [EmergencyStop()]


def client_without_tls(_keys: Path, _folder: Path) -> str:
    return "none"


def client_of_another_authority(_keys: Path, folder: Path) -> str:
    make_keys(folder)
    return str(folder)


def client_with_foreign_certificate(keys: Path, folder: Path) -> str:
    make_keys(folder)
    (folder / "ca.crt").write_bytes((keys / "ca.crt").read_bytes())  # trusts the robot, which knows it not
    return str(folder)


def client_with_the_key_of_another(keys: Path, folder: Path) -> str:
    make_keys(folder)
    for name in ("ca.crt", "client.crt"):
        (folder / name).write_bytes((keys / name).read_bytes())
    return str(folder)


def client_with_certificate_of_the_robot(keys: Path, folder: Path) -> str:
    for name, source in (("ca.crt", "ca.crt"), ("client.crt", "robot.crt"), ("client.key", "robot.key")):
        (folder / name).write_bytes((keys / source).read_bytes())
    return str(folder)


@pytest.mark.parametrize(
    "prepare",
    [
        client_without_tls,
        client_of_another_authority,
        client_with_foreign_certificate,
        client_with_the_key_of_another,
        client_with_certificate_of_the_robot,
    ],
)
def test_client_with_wrong_keys_is_refused(
    encrypted: Robot, keys: Path, tmp_path: Path, prepare: Callable[[Path, Path], str]
) -> None:
    with pytest.raises(ThumperError, match=r"its keys \(\[bus\] tls\)"):
        BusClient("r1", encrypted.address, TOKEN, tls=prepare(keys, tmp_path))


def test_client_with_the_keys_needs_the_token_too(encrypted: Robot, keys: Path) -> None:
    with pytest.raises(ThumperError, match="token"):
        BusClient("r1", encrypted.address, "wrong horse !", tls=str(keys))


def test_who_has_the_clients_key_cannot_pose_as_the_robot(keys: Path, tmp_path: Path) -> None:
    for name, source in (("ca.crt", "ca.crt"), ("robot.crt", "client.crt"), ("robot.key", "client.key")):
        (tmp_path / name).write_bytes((keys / source).read_bytes())
    impostor = Robot(TOKEN, tls=str(tmp_path))
    try:
        with pytest.raises(ThumperError, match="refuses the connection"):
            BusClient("r1", impostor.address, TOKEN, tls=str(keys))
    finally:
        impostor.server.close()


def test_missing_keys_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bus_keys, "default_folder", lambda: tmp_path / "none")
    address = f"127.0.0.1:{free_port()}"
    (tmp_path / "ca.crt").touch()
    with pytest.raises(ThumperError, match=r"robot\.crt is missing") as caught:
        BusServer("r1", BusOptions(address=address, tls=str(tmp_path)), RequestQueue(), print)
    assert caught.value.exit_code == 2
    # Beyond loopback the bus is encrypted unless the configuration says otherwise.
    public = f"0.0.0.0:{free_port()}"
    with pytest.raises(ThumperError, match="thumper bus keys"):
        BusServer("r1", BusOptions(address=public, token=TOKEN), RequestQueue(), print)
    with pytest.raises(ThumperError, match=r"copy ca\.crt, client\.crt and client\.key"):
        BusClient("r1", "192.0.2.1:7448", TOKEN)
    server = BusServer("r1", BusOptions(address=public, token=TOKEN, tls="none"), RequestQueue(), print)
    with BusClient("r1", public, TOKEN, tls="none") as client:
        assert client.robot == "r1"
    server.close()


def test_keys_are_secret_and_never_overwritten(keys: Path) -> None:
    for path in keys.glob("*.key"):
        assert path.stat().st_mode & 0o777 == 0o600
    before = {path: path.read_bytes() for path in keys.iterdir()}
    with pytest.raises(ThumperError, match="exists already"):
        make_keys(keys)
    assert {path: path.read_bytes() for path in keys.iterdir()} == before
    assert not (keys / "ca.key").exists()


def test_nothing_readable_crosses_an_encrypted_bus(encrypted: Robot, keys: Path) -> None:
    """Read the link between client and robot through a proxy: no topic name, no token."""
    port = free_port()
    host, _, robot_port = encrypted.address.partition(":")
    seen = bytearray()

    def forward(source: socket.socket, sink: socket.socket) -> None:
        while data := source.recv(65536):
            seen.extend(data)
            sink.sendall(data)

    def serve() -> None:
        while True:
            near, _ = listener.accept()
            far = socket.create_connection((host, int(robot_port)))
            for pair in ((near, far), (far, near)):
                threading.Thread(target=forward, args=pair, daemon=True).start()

    with socket.create_server(("127.0.0.1", port)) as listener:
        threading.Thread(target=serve, daemon=True).start()
        with BusClient("r1", f"127.0.0.1:{port}", TOKEN, tls=str(keys)) as client:
            client.publish("estop", flag(True))
            assert encrypted.received() == [EmergencyStop()]
        assert len(seen) > 1000
        for secret in (b"thumper/r1", b"estop", TOKEN.encode()):
            assert secret not in seen


def test_no_client_can_publish_or_answer_as_the_robot() -> None:
    robot = Robot()
    session = open_client(robot.address, "")
    answered: list[bool] = []
    try:
        with BusClient("r1", robot.address) as client:
            poses: list[Any] = []
            client.subscribe("pose", poses.append)
            lost: list[bool] = []
            client.on_lost(lambda: lost.append(True))

            def lie(query: zenoh.Query) -> None:
                answered.append(True)
                query.reply(query.key_expr, json.dumps({"ok": True, "text": "a lie"}))

            queryable = session.declare_queryable("thumper/r1/ask/**", lie, complete=True)
            session.liveliness().declare_token("thumper/r1/presence")
            for _ in range(5):
                session.put("thumper/r1/pose", encode(M.pose(0.0, Pose2(x_m=99.0))))
                session.delete("thumper/r1/pose")
                time.sleep(0.05)
            robot.server.publish("pose", 0.0, M.pose(0.0, Pose2(x_m=1.0)))
            until(lambda: poses)
            assert [pose.pose.pose.position.x for pose in poses] == [1.0]
            with pytest.raises(ThumperError):
                client.query("nonsense")
            assert not answered
            assert queryable is not None  # alive until here
    finally:
        session.close()  # type: ignore[no-untyped-call]
        robot.server.close()


SENDER = """
import subprocess
import sys
import threading
import time
import zenoh
from thumper.bus.zenoh_session import open_client
session = open_client(sys.argv[1], "")
block = zenoh.CongestionControl.BLOCK
session.put("thumper/r1/estop", bytes(150_000_000), congestion_control=block)
session.put("thumper/r1/command", b"the end", congestion_control=block)
time.sleep(1.0)
session.close()
"""


def test_huge_message_is_refused_before_it_is_read() -> None:
    robot = Robot()
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # forget the peak so far
        before_MB = peak_MB()
        subprocess.run([sys.executable, "-c", SENDER, robot.address], check=True)
        until(lambda: robot.server.statistics.refused)
        assert peak_MB() - before_MB < 20.0
        assert "command" in robot.reported[0]  # the first message never arrived
        with BusClient("r1", robot.address) as client:
            client.publish("estop", flag(True))
            assert robot.received() == [EmergencyStop()]
    finally:
        robot.server.close()


def peak_MB() -> float:
    (line,) = re.findall(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text(encoding="ascii"))
    return float(line) / 1000.0
