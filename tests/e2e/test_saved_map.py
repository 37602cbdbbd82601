"""Drive in a saved map, from a given pose or after global localization."""

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig, with_ports
from thumper.navigation.goal import Goal
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.display import NoDisplay
from thumper.runtime.drive.tasks import drive_to_goal
from thumper.runtime.drive_result import DriveProgress
from thumper.slam.mode_switch import SlamModeSwitch
from thumper_hil.bench.registry import simulation
from thumper_hil.world.world import World

START = Pose2(x_m=1.7, y_m=0.1, theta_rad=3.0)


@pytest.mark.parametrize("start", [Pose2(x_m=1.75, y_m=0.05, theta_rad=3.05), None])
def test_the_robot_reaches_a_goal_in_a_saved_map(start: Pose2 | None) -> None:
    name = f"saved-{start is None}"
    config = with_ports(
        RobotConfig(),
        board=f"sim://{name}/board?world=lab&x_m=1.7&y_m=0.1&yaw_deg=171.9&seed=4",
        lidar=f"sim://{name}/lidar",
    )
    known = World.load("lab").to_grid()
    with open_robot(config, start, known) as robot:
        result = robot.run(drive_to_goal(Goal(x_m=-0.3, y_m=0.0, tolerance_m=0.1)))
        _, x_m, y_m, theta_rad = simulation(name).truth()[-1, :4]
        assert result.reached, result.reason
        assert isinstance(robot.mapper, SlamModeSwitch)
        assert robot.mapper.grid() is known
        assert robot.mapper.quality().lost == ""
    assert Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad).distance_m(result.pose) < 0.06


def test_a_kidnapped_robot_stops_relocalizes_and_drives_on() -> None:
    config = with_ports(
        RobotConfig(),
        board="sim://carried/board?world=lab&x_m=1.7&y_m=0.1&yaw_deg=171.9&seed=4",
        lidar="sim://carried/lidar",
    )
    with open_robot(config, START, World.load("lab").to_grid()) as robot:
        goal = Goal(x_m=-0.3, y_m=0.0, tolerance_m=0.1)
        lab, reasons = simulation("carried"), list[str]()

        def carry_after_3_s(_: DriveProgress) -> None:
            if not reasons and lab.truth()[-1, 0] >= 3.0:
                lab.chip.place(Pose2(x_m=2.5))
                reasons.append("carried")
            elif reasons:
                reasons.append(robot.mapper.quality().lost)

        result = robot.run(drive_to_goal(goal), NoDisplay(on_progress=carry_after_3_s))
        assert result.reached, result.reason
        assert any("the map explains only" in reason for reason in reasons)
        steps_m = np.hypot(*np.diff(lab.truth()[:, 1:3], axis=0).T)
        assert result.path_length_m == pytest.approx(
            steps_m[steps_m < 0.5].sum(), abs=0.1
        )  # without the kidnapping
        _, x_m, y_m, theta_rad = lab.truth()[-1, :4]
    assert Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad).distance_m(result.pose) < 0.06
