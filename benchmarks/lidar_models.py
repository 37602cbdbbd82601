"""Explore `lab_box` with each lidar under the preset `hard`, and print what came of it.

Run: python benchmarks/lidar_models.py [MODEL ...]

The robot starts at (2.05, 0.64) without a map, and returns there. Firmware, driver and the simulated
lidar exchange the bytes of the real ones. The pose error is that of the estimate at the end.
"""

import math
import sys
from pathlib import Path
from typing import get_args

from thumper.board.options import BoardOptions
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarModel, LidarOptions
from thumper.navigation.goal import Goal
from thumper.navigation.planners.frontier_exploration import ExplorationOptions, Explorer
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.exploration import explore
from thumper_hil.bench import simulation

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

START = Pose2(x_m=2.05, y_m=0.64, theta_rad=math.radians(-146.87))
LIMIT_S = 240.0


def explore_with(model: LidarModel, seed: int) -> tuple[bool, int, float, str]:
    """Return whether the robot came home, its contacts, its pose error [m] and the report."""
    name = f"{model}-{seed}"
    options = f"world=lab_box&preset=hard&lidar={model}&seed={seed}&x_m=2.05&y_m=0.64&yaw_deg=-146.87"
    config = RobotConfig(
        board=BoardOptions(port=f"sim://{name}/board?{options}"),
        lidar=LidarOptions(port=f"sim://{name}/lidar", model=model),
    )
    reports: list[str] = []
    with open_robot(config, START) as robot:
        bench = simulation(name)
        task = explore(
            Explorer(ExplorationOptions(), config.footprint),
            robot.map_and_pose,
            Goal(x_m=START.x_m, y_m=START.y_m, tolerance_m=0.15),
            limit_s=LIMIT_S,
            report=reports.append,
        )
        result = robot.run(task)
        (_, pose), truth = robot.map_and_pose(), bench.truth()[-1]
        error_m = math.hypot(pose.x_m - truth[1], pose.y_m - truth[2])
        return result.reached, bench.contacts, error_m, reports[-1]


def main() -> None:
    """Print a line for each model."""
    for model in get_args(LidarModel):
        if len(sys.argv) == 1 or model in sys.argv:
            is_home, contacts, error_m, report = explore_with(model, 1)
            print(f"{model}: {'home' if is_home else 'not home'}; {report}")
            what = f"explore lab_box, hard, {model}: contacts, pose error"
            figure(what, f"{contacts} / {error_m:.3f} m", aim="0 / -")


if __name__ == "__main__":
    main()
