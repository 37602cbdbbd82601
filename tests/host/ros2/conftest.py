"""A router, a robot's end of the bus, its ROS gateway, and an independent ROS client: `zenoh-ros2-sdk`."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from benchmarks.shared.live import END_WITH_PARENT, free_port
from zenoh_ros2_sdk import ROS2Subscriber, ZenohSession, get_registry

from tests.host.bus.test_bus import Robot
from thumper.bus.client import BusClient
from thumper.bus.zenoh_session import open_ros_client
from thumper.common.errors import ThumperError
from thumper.config.robot import RobotConfig
from thumper.ros.codec import typestore
from thumper.ros2.gateway import RosGateway
from thumper.ros2.node import RosNode
from thumper.ros2.services import RosServices
from thumper.ros2.wire import NodeName

ROOT = Path(__file__).parents[3]
THUMPER = Path(sys.executable).with_name("thumper")
NO_FIELDS = "uint8 structure_needs_at_least_one_member"  # as rosidl; the SDK forgets it in parts
SIMULATION = "world=lab&x_m=1.73&y_m=0.08&yaw_deg=180"


class Gateway:
    """The robot's end of the bus and its node in domain 7."""

    def __init__(self, router: int, namespace: str = "", *, navigates: bool = True) -> None:
        self.robot = Robot()
        self.reported: list[str] = []
        self.bus = BusClient("r1", self.robot.address)
        session = open_ros_client(f"127.0.0.1:{router}", "")
        self.node = RosNode(NodeName(domain_id=7, name="r1", namespace=namespace), session)
        config = RobotConfig(name="r1")
        self.gateway = RosGateway(self.bus, self.node, config, self.reported.append, navigates=navigates)
        RosServices(self.bus, self.node, navigates=navigates)

    def close(self) -> None:
        self.node.close()
        self.bus.close()
        self.robot.server.close()


@pytest.fixture(scope="session")
def router(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """Return the port of a router in its own process, to which the SDK is connected."""
    port = free_port()
    command = [*END_WITH_PARENT, sys.executable, "-m", "tests.host.ros2.router", str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            sdk = ZenohSession.get_instance("127.0.0.1", port)  # one per process
            get_registry(str(definitions(tmp_path_factory.mktemp("ros"))))
            yield port
            sdk.session.close()
        finally:
            process.terminate()


def definitions(folder: Path) -> Path:
    """Write the standard message definitions where the SDK looks for them: it would download them."""
    for name in (name for name in typestore().fielddefs if "/msg/" in name):
        text = typestore().generate_msgdef(name, ros_version=2)[0].split("=" * 80)[0]
        path = folder / f"{name}.msg"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text.strip() or NO_FIELDS, encoding="utf-8")
    return folder


@pytest.fixture
def gateway(router: int) -> Iterator[Gateway]:
    gateway = Gateway(router)
    yield gateway
    gateway.close()


class Live:
    """A running robot and what the ROS client has received from it."""

    def __init__(self, bus: str, tmp: Path, router: int) -> None:
        board, lidar = f"sim://ros/board?{SIMULATION}", "sim://ros/lidar"
        ports = ["--board", board, "--lidar", lidar, "--start", "1.73", "0.08", "180"]
        self.robot = self._start(["run", *ports, "--bus", bus, "--out", str(tmp / "run")])
        self._await(self.robot, "is running")
        self.ros = self._start(
            ["ros", "--bus", bus, "--router", f"127.0.0.1:{router}", "--domain", "9", "--namespace", "/live"]
        )
        self._await(self.ros, "/live/thumper is a node of domain 9")
        self.poses: list[Any] = []
        self.odometry: list[Any] = []
        types = (("pose", "geometry_msgs/msg/PoseWithCovarianceStamped", self.poses),)
        for topic, type_name, received in (*types, ("odom", "nav_msgs/msg/Odometry", self.odometry)):
            ROS2Subscriber(f"/live/{topic}", type_name, received.append, domain_id=9)
        self.bus = BusClient("thumper", bus)
        self.statuses: list[Any] = []
        self.bus.subscribe("status", self.statuses.append)
        self.folder = tmp / "run"

    @property
    def status(self) -> Any:
        """The robot's newest status."""
        return self.statuses[-1]

    def close(self) -> None:
        self.bus.close()
        for process in (self.ros, self.robot):
            process.send_signal(2)
            assert process.wait(30) in (0, 130)

    @staticmethod
    def _start(arguments: list[str]) -> "subprocess.Popen[str]":
        command = [*END_WITH_PARENT, str(THUMPER), *arguments]
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    @staticmethod
    def _await(process: "subprocess.Popen[str]", text: str) -> None:
        assert process.stdout is not None
        lines = []
        for line in process.stdout:
            lines.append(line)
            if text in line:
                return
        raise AssertionError("".join(lines))


@pytest.fixture(scope="package")
def live(router: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    live = Live(f"127.0.0.1:{free_port()}", tmp_path_factory.mktemp("ros"), router)
    yield live
    live.close()


def is_done(live: Live, command: str) -> bool:
    """Return whether the robot did it: on a busy machine its process may have hung, and it then refuses."""
    with suppress(ThumperError):
        return bool(live.bus.query("command", {"command": command})["ok"])
    return False
