"""The path law of the last stretch, on a robot that turns by a part of what it is commanded."""

import math

import numpy as np
import pytest

from thumper.common.geometry import Pose2, Twist2
from thumper.navigation.speed_limits import SpeedLimits
from thumper.odometry.wheel_odometry import advance
from thumper.runtime.drive.dock_approach import LOST_S, approach
from thumper.runtime.drive.motions import MotionEnd
from thumper.runtime.state_estimator import RobotState


def state(time_s: float, twist: Twist2) -> RobotState:
    return RobotState(
        time_s=time_s, map_from_base=Pose2(), twist=twist, hits_in_map_m=np.empty((0, 2)), scan_age_s=0.0
    )


@pytest.mark.parametrize("turns", [0.6, 1.0])
@pytest.mark.parametrize("beside_m", [-0.06, 0.0, 0.06])
@pytest.mark.parametrize("heading_deg", [-8.0, 0.0, 8.0])
def test_it_ends_on_the_axis(turns: float, beside_m: float, heading_deg: float) -> None:
    at = Pose2(x_m=-0.7, y_m=beside_m, theta_rad=math.radians(heading_deg))
    motion = approach(lambda: at, lambda: 0.0, speed_m_s=0.08, limits=SpeedLimits())
    twist = Twist2()
    for cycle in range(300):
        command = motion(state(0.1 * cycle, twist))
        if isinstance(command, MotionEnd):
            break
        at = advance(at, 0.1 * twist.v_m_s, 0.1 * turns * twist.w_rad_s)
        twist = command  # takes effect one cycle later
    assert isinstance(command, MotionEnd)
    assert command.done
    assert at.x_m == pytest.approx(0.0, abs=0.004)
    assert at.y_m == pytest.approx(0.0, abs=0.007)
    assert math.degrees(at.theta_rad) == pytest.approx(0.0, abs=2.0)


def test_it_stops_without_the_tag() -> None:
    ages_s = iter([0.0, LOST_S, LOST_S + 0.1])
    motion = approach(lambda: Pose2(x_m=-0.5), lambda: next(ages_s), speed_m_s=0.08, limits=SpeedLimits())
    assert [isinstance(motion(state(0.0, Twist2())), MotionEnd) for _ in range(3)] == [False, False, True]
