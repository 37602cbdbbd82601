"""A router, a robot's end of the bus, its ROS gateway, and an independent ROS client: `zenoh-ros2-sdk`."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from benchmarks.shared.live import END_WITH_PARENT, free_port
from zenoh_ros2_sdk import ZenohSession, get_registry

from tests.host.bus.test_bus import Robot
from thumper.bus.client import BusClient
from thumper.bus.zenoh_session import open_ros_client
from thumper.config.robot import RobotConfig
from thumper.ros.codec import typestore
from thumper.ros2.gateway import RosGateway
from thumper.ros2.node import RosNode
from thumper.ros2.wire import NodeName

ROOT = Path(__file__).parents[3]


class Gateway:
    """The robot's end of the bus and its node in domain 7."""

    def __init__(self, router: int, namespace: str = "") -> None:
        self.robot = Robot()
        self.reported: list[str] = []
        self.bus = BusClient("r1", self.robot.address)
        session = open_ros_client(f"127.0.0.1:{router}", "")
        self.node = RosNode(NodeName(domain_id=7, name="r1", namespace=namespace), session)
        self.gateway = RosGateway(self.bus, self.node, RobotConfig(name="r1"), self.reported.append)

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
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        sdk = ZenohSession.get_instance("127.0.0.1", port)  # one per process
        get_registry(str(_definitions(tmp_path_factory.mktemp("ros"))))
        yield port
        sdk.session.close()
        process.terminate()


def _definitions(folder: Path) -> Path:
    """Write the standard message definitions where the SDK looks for them: it would download them."""
    for name in typestore().fielddefs:
        text = typestore().generate_msgdef(name, ros_version=2)[0].split("=" * 80)[0]
        path = folder / f"{name}.msg"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return folder


@pytest.fixture
def gateway(router: int) -> Iterator[Gateway]:
    gateway = Gateway(router)
    yield gateway
    gateway.close()
