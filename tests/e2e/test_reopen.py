"""A process that opens one robot after another keeps only the present one."""

import weakref

from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig, with_ports
from thumper.runtime.assembly import open_robot
from thumper.slam.mapper import Mapper


def opened_once(name: str) -> weakref.ref[Mapper]:
    config = with_ports(RobotConfig(), board=f"sim://{name}/board?world=lab", lidar=f"sim://{name}/lidar")
    with open_robot(config, Pose2()) as robot:
        robot.wait_for_map()
        return weakref.ref(robot.mapper)


def test_earlier_robot_leaves_the_memory() -> None:
    first = opened_once("reopened1")
    opened_once("reopened2")
    assert first() is None
