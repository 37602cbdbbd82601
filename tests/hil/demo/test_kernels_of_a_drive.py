"""No kernel is compiled, or loaded from the cache, once the robot is open: that would stop its loop."""

import multiprocessing

import pytest

from thumper.common.compiled_kernel import KernelCache
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig, with_ports
from thumper.navigation.goal import Goal
from thumper.navigation.planners.frontier_exploration import ExplorationOptions, Explorer
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive import tasks
from thumper.runtime.drive.exploration import explore
from thumper.runtime.loop import RobotLoop
from thumper.slam.mode_switch import SlamModeSwitch

BOARD = "sim://kernels/board?world=lab&x_m=1.73&y_m=0.64&yaw_deg=180"
HOME = Goal(x_m=0.0, y_m=0.0)


def kernels_loaded_late() -> list[str]:
    """Return the kernels that a robot loads while it explores, localizes, drives and resumes mapping."""
    late: list[str] = []
    with open_robot(with_ports(RobotConfig(), board=BOARD, lidar="sim://kernels/lidar"), Pose2()) as robot:
        KernelCache.load_overload = lambda cache, *_: late.append(cache._py_func.__module__)  # type: ignore
        use(robot)
    return [module for module in late if not module.startswith("thumper_hil")]


def use(robot: RobotLoop) -> None:
    explorer = Explorer(ExplorationOptions(), RobotConfig().footprint)
    robot.run(explore(explorer, robot.map_and_pose, HOME, limit_s=20.0))
    mapper = robot.mapper
    assert isinstance(mapper, SlamModeSwitch)
    mapper.localize()
    mapper.relocalize()
    robot.run(tasks.wait(3.0))
    robot.run(tasks.drive_to_goal(Goal(x_m=0.5, y_m=0.0)))
    assert mapper.localizer is not None
    assert mapper.localizer.relocalizations > 0
    mapper.resume_from(mapper.counts(), robot.map_and_pose()[1])
    robot.run(tasks.wait(3.0))
    assert not mapper.is_localizing


@pytest.mark.slow
def test_no_kernel_is_loaded_after_the_start() -> None:
    """In a process of its own: tests before this one have loaded most kernels."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        late = pool.apply(kernels_loaded_late)
    assert not late, late
