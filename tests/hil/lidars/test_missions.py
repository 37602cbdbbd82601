"""Drive the demo's straight mission with each lidar on the hardest robot; the host's computing takes time."""

import math

import pytest

from tests.variants import some_of
from thumper.board.options import BoardOptions
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarModel, LidarOptions
from thumper.navigation.goal import Goal
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.tasks import drive_to_goal
from thumper_hil.bench import simulation
from thumper_hil.demo.map_error import compare_map
from thumper_hil.demo.missions import STRAIGHT, TOLERANCE_M
from thumper_hil.world.world import World


@pytest.mark.parametrize(
    "model", some_of(["urg04lx", "ld19", "rplidar_a1", "rplidar_a2", "rplidar_c1", "ydlidar_x4"])
)
def test_straight_mission_succeeds(model: LidarModel) -> None:
    start = STRAIGHT.start
    url = (
        f"sim://{model}/board?world={STRAIGHT.world}&lidar={model}&preset=hard"
        f"&x_m={start.x_m}&y_m={start.y_m}&yaw_deg={math.degrees(start.theta_rad)}"
    )
    config = RobotConfig(
        board=BoardOptions(port=url), lidar=LidarOptions(port=f"sim://{model}/lidar", model=model)
    )
    goal = Goal(x_m=STRAIGHT.goal_x_m, y_m=STRAIGHT.goal_y_m)
    with open_robot(config, start) as robot:
        bench = simulation(model)
        result = robot.run(drive_to_goal(goal))
        grid = robot.mapper.grid()
    assert result.reached, result.reason
    x_m, y_m = bench.truth()[-1, 1:3]
    assert math.hypot(x_m - goal.x_m, y_m - goal.y_m) < TOLERANCE_M
    assert bench.contacts == 0
    assert compare_map(grid, World.load(STRAIGHT.world)).wall_error_mean_m < 0.05
