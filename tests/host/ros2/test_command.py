"""`thumper run` with a simulated robot and `thumper ros`, each in its process, driven by a ROS client."""

import math
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from benchmarks.shared.live import END_WITH_PARENT, free_port, until
from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber

from tests.host.bus.test_bus import M
from thumper.bus.client import BusClient
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.ros.from_ros import pose_of

THUMPER = Path(sys.executable).with_name("thumper")
SIMULATION = "world=lab&x_m=1.73&y_m=0.08&yaw_deg=180"


class Live:
    """A running robot and what the ROS client has received from it."""

    def __init__(self, bus: str, tmp: Path, router: int) -> None:
        board, lidar = f"sim://ros/board?{SIMULATION}", "sim://ros/lidar"
        ports = ["--board", board, "--lidar", lidar, "--start", "1.73", "0.08", "180"]
        self._robot = self._start(["run", *ports, "--bus", bus, "--out", str(tmp / "run")])
        self._await(self._robot, "is running")
        self._ros = self._start(
            ["ros", "--bus", bus, "--router", f"127.0.0.1:{router}", "--domain", "9", "--namespace", "/live"]
        )
        self._await(self._ros, "/live/thumper is a node of domain 9")
        self.poses: list[Any] = []
        self.odometry: list[Any] = []
        types = (("pose", "geometry_msgs/msg/PoseWithCovarianceStamped", self.poses),)
        for topic, type_name, received in (*types, ("odom", "nav_msgs/msg/Odometry", self.odometry)):
            ROS2Subscriber(f"/live/{topic}", type_name, received.append, domain_id=9)
        self.bus = BusClient("thumper", bus)

    def close(self) -> None:
        self.bus.close()
        for process in (self._ros, self._robot):
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


@pytest.fixture(scope="module")
def live(router: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    live = Live(f"127.0.0.1:{free_port()}", tmp_path_factory.mktemp("ros"), router)
    yield live
    live.close()


def is_done(live: Live, command: str) -> bool:
    """Return whether the robot did it: on a busy machine its process may have hung, and it then refuses."""
    with suppress(ThumperError):
        return bool(live.bus.query("command", {"command": command})["ok"])
    return False


def test_goal_pose_drives_the_robot_there(live: Live) -> None:
    goal = M.goal(0.0, Pose2(x_m=1.2, y_m=0.05, theta_rad=math.pi))
    publisher = ROS2Publisher("/live/goal_pose", "geometry_msgs/msg/PoseStamped", domain_id=9)
    until(lambda: live.poses, 30.0)
    publisher.publish(header=goal.header, pose=goal.pose)

    def is_there() -> bool:
        pose = pose_of(live.poses[-1].pose.pose)
        return math.hypot(pose.x_m - 1.2, pose.y_m - 0.05) < 0.12

    until(is_there, 60.0)


def test_cmd_vel_turns_the_armed_robot_and_its_end_stops_it(live: Live) -> None:
    publisher = ROS2Publisher("/live/cmd_vel", "geometry_msgs/msg/TwistStamped", domain_id=9)
    turn = M.twist(0.0, Twist2(w_rad_s=0.8))
    until(lambda: is_done(live, "arm"), 30.0)

    def turns() -> bool:
        publisher.publish(header=turn.header, twist=turn.twist)
        return bool(live.odometry[-1].twist.twist.angular.z > 0.4)

    until(turns, 30.0)
    until(lambda: abs(live.odometry[-1].twist.twist.angular.z) < 0.02, 30.0)  # silent: 0.3 s, then zero
    live.bus.query("command", {"command": "disarm"})
