"""Straight motions and turns of a base that follows each command one cycle late."""

import math

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.navigation.costmap.local_model import ObstaclePoints
from thumper.navigation.footprint import Footprint
from thumper.navigation.navigator import USUAL_PERIOD_S
from thumper.navigation.safety.collision_monitor import CollisionMonitor, CollisionMonitorOptions
from thumper.navigation.speed_limits import SpeedLimits
from thumper.runtime.drive.motions import (
    Motion,
    MotionEnd,
    before_obstacles,
    drive_on_heading,
    spin,
)
from thumper.runtime.state_estimator import RobotState

LIMITS = SpeedLimits()
NOTHING = np.empty((0, 2))


def drive(
    motion: Motion,
    start: Pose2,
    *,
    gain: float = 1.0,
    hits_m: FloatArray = NOTHING,
    scan_age_s: float = 0.0,
    cycles: int = 2000,
) -> tuple[MotionEnd, Pose2, float]:
    """Return how the motion ended, where, and after which time; each command acts one cycle late."""
    pose, twist, time_s = start, Twist2(), 0.0
    commands = [Twist2()]
    for _ in range(cycles):
        state = RobotState(
            time_s=time_s, map_from_base=pose, twist=twist, hits_in_map_m=hits_m, scan_age_s=scan_age_s
        )
        command = motion(state)
        if isinstance(command, MotionEnd):
            return command, pose, time_s
        commands.append(command)
        twist = Twist2(v_m_s=gain * commands[-2].v_m_s, w_rad_s=gain * commands[-2].w_rad_s)
        pose = pose @ Pose2(theta_rad=0.5 * twist.w_rad_s * USUAL_PERIOD_S)
        pose = pose @ Pose2(x_m=twist.v_m_s * USUAL_PERIOD_S, theta_rad=0.5 * twist.w_rad_s * USUAL_PERIOD_S)
        time_s += USUAL_PERIOD_S
    raise AssertionError("the motion did not end")


@pytest.mark.parametrize("distance_m", [0.05, 1.0, -0.6, 4.0])
def test_a_straight_motion_ends_at_its_distance(distance_m: float) -> None:
    start = Pose2(x_m=1.0, y_m=2.0, theta_rad=2.5)
    end, pose, _ = drive(drive_on_heading(distance_m, LIMITS, start), start)
    offset = start.inverse() @ pose
    assert end.done
    assert offset.x_m == pytest.approx(distance_m, abs=0.01)
    assert offset.y_m == pytest.approx(0.0, abs=0.002)


def test_a_straight_motion_returns_to_its_line() -> None:
    start = Pose2(x_m=0.0, y_m=0.04, theta_rad=0.08)
    end, pose, _ = drive(drive_on_heading(2.0, LIMITS, Pose2()), start)
    assert end.done
    assert pose.y_m == pytest.approx(0.0, abs=0.01)
    assert pose.theta_rad == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("angle_rad", [0.05, math.pi / 2, -math.pi, 3.0 * math.pi])
def test_a_turn_ends_at_its_angle(angle_rad: float) -> None:
    start = Pose2(theta_rad=3.0)
    end, pose, time_s = drive(spin(angle_rad, LIMITS, start.theta_rad), start)
    assert end.done
    off_rad = math.remainder(pose.theta_rad - start.theta_rad - angle_rad, math.tau)
    assert off_rad == pytest.approx(0.0, abs=0.018)
    assert time_s > 0.9 * abs(angle_rad) / LIMITS.w_max_rad_s  # more than a turn is not cut short


def test_a_base_that_turns_too_far_is_brought_back() -> None:
    """The wheels slip less than usual: without the second look the robot would stop 8 degrees too far."""
    end, pose, _ = drive(spin(math.pi / 2, LIMITS, 0.0), Pose2(), gain=1.6)
    assert end.done
    assert pose.theta_rad == pytest.approx(math.pi / 2, abs=0.03)


def test_wheels_that_slip_end_the_motion() -> None:
    end, _, time_s = drive(drive_on_heading(1.0, LIMITS, Pose2()), Pose2(), gain=0.0)
    assert not end.done
    assert "slip" in end.reason
    assert time_s < 20.0


def monitored(motion: Motion) -> Motion:
    return before_obstacles(motion, CollisionMonitor(CollisionMonitorOptions(), LIMITS, Footprint()))


def test_an_obstacle_ends_the_motion_before_the_contact() -> None:
    wall_m = np.column_stack((np.full(40, 1.0), np.linspace(-0.4, 0.4, 40)))
    end, pose, _ = drive(monitored(drive_on_heading(2.0, LIMITS, Pose2())), Pose2(), hits_m=wall_m)
    assert not end.done
    assert "stopped before an obstacle" in end.reason
    assert 0.4 < pose.x_m < 1.0 - 0.21


def test_the_corner_of_a_turning_robot_stops_before_a_post() -> None:
    post_m = np.array([[0.0, 0.22]])  # beside the robot, in the way of its corners
    end, pose, _ = drive(monitored(spin(math.pi, LIMITS, 0.0)), Pose2(), hits_m=post_m)
    assert not end.done
    assert pose.theta_rad < 1.0


@pytest.mark.parametrize(
    ("seen", "reason"),
    [(0, "ground that the lidar has never seen"), (1, "an obstacle")],
)
def test_what_is_remembered_or_unseen_behind_the_robot_ends_the_motion(seen: int, reason: str) -> None:
    """The newest scan shows nothing there. Only unseen ground is a reason to look."""
    behind = ObstaclePoints(np.array([[-0.8, 0.0]]), np.zeros(1), seen)
    monitor = CollisionMonitor(CollisionMonitorOptions(), LIMITS, Footprint())

    def back() -> Motion:
        return drive_on_heading(-1.0, LIMITS, Pose2())

    end, pose, _ = drive(before_obstacles(back(), monitor, lambda _: behind, cure="look first"), Pose2())
    assert not end.done
    assert pose.x_m > -0.8 + 0.21
    assert end.reason.startswith(f"stopped before {reason} ")
    assert end.reason.endswith("look first") is not bool(seen)
    end, _, _ = drive(before_obstacles(back(), monitor, lambda _: behind.without_unseen()), Pose2())
    assert end.done is not bool(seen)


def test_one_false_return_does_not_end_the_motion() -> None:
    motion, wall_m = monitored(drive_on_heading(1.0, LIMITS, Pose2())), np.array([[0.25, 0.0]])

    def seen(state: RobotState) -> Twist2 | MotionEnd:
        is_false = 0.35 < state.time_s < 0.75
        return motion(
            RobotState(
                time_s=state.time_s,
                map_from_base=state.map_from_base,
                twist=state.twist,
                hits_in_map_m=wall_m if is_false else NOTHING,
                scan_age_s=0.0,
            )
        )

    end, pose, _ = drive(seen, Pose2())
    assert end.done
    assert pose.x_m == pytest.approx(1.0, abs=0.01)


def test_without_scans_the_robot_stays() -> None:
    end, pose, _ = drive(monitored(drive_on_heading(1.0, LIMITS, Pose2())), Pose2(), scan_age_s=0.6)
    assert not end.done
    assert "lidar" in end.reason
    assert pose == Pose2()
