"""Braking as the board brakes: each wheel on its own ramp, against closed forms."""

import math

import numpy as np
import pytest

from thumper.common.geometry import Pose2, Twist2
from thumper.common.kinematics import DriveGeometry
from thumper.navigation.footprint import Footprint
from thumper.navigation.safety.collision_monitor import CollisionMonitor, CollisionMonitorOptions
from thumper.navigation.speed_limits import SpeedLimits, WheelRamp

LIMITS, DRIVE = SpeedLimits(), DriveGeometry()
RAMP = WheelRamp.from_drive(LIMITS)
SLOW = WheelRamp(accel_m_s2=0.496, decel_m_s2=0.496, half_track_m=RAMP.half_track_m)  # 8 rad/s^2
BEND = Twist2(v_m_s=0.4, w_rad_s=1.2)
PERIOD_S = 0.1


def test_inner_wheel_stops_first_and_the_robot_swings_round_it() -> None:
    """w holds until the inner side has stopped, then fades: 1.2 t1 + 1.2^2 / (2 rate) = 0.97 rad."""
    step_s = 1e-3
    times_s = np.arange(0.0, SLOW.braking_s(BEND), step_s) + 0.5 * step_s
    _, w_rad_s = SLOW.braked(BEND, times_s)
    inner_s = (BEND.v_m_s - SLOW.half_track_m * BEND.w_rad_s) / SLOW.decel_m_s2
    rate = SLOW.decel_m_s2 / DRIVE.track_m
    turn_rad = BEND.w_rad_s * inner_s + BEND.w_rad_s**2 / (2.0 * rate)
    assert turn_rad == pytest.approx(0.968, abs=1e-3)
    assert w_rad_s.sum() * step_s == pytest.approx(turn_rad, abs=2e-3)
    assert w_rad_s[times_s < inner_s] == pytest.approx(BEND.w_rad_s)
    assert w_rad_s[-1] < 0.01


@pytest.mark.parametrize("twist", [BEND, Twist2(v_m_s=-0.2, w_rad_s=0.5), Twist2(w_rad_s=1.0)])
def test_braking_is_symmetric(twist: Twist2) -> None:
    times_s = np.linspace(0.0, 1.5, 50)
    v_m_s, w_rad_s = RAMP.braked(twist, times_s)
    v_other, w_other = RAMP.braked(Twist2(v_m_s=twist.v_m_s, w_rad_s=-twist.w_rad_s), times_s)
    assert v_other == pytest.approx(v_m_s)
    assert w_other == pytest.approx(-w_rad_s)
    assert (v_m_s[-1], w_rad_s[-1]) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("rim_m_s", "target_m_s", "next_m_s"),
    [
        (0.0, 0.4, 0.05),
        (0.2, 0.4, 0.25),
        (0.4, 0.0, 0.25),
        (0.1, 0.0, 0.0),
        (0.1, 0.2, 0.15),
        (-0.4, -0.3, -0.3),
        (-0.4, -0.35, -0.35),
        (0.3, -0.3, 0.15),
        (0.1, -0.3, 0.0),
        (0.02, -0.02, -0.02),
        (0.04, -0.3, -0.01),
    ],
)
def test_a_rim_follows_the_ramp_of_the_board(rim_m_s: float, target_m_s: float, next_m_s: float) -> None:
    ramp = WheelRamp(accel_m_s2=0.5, decel_m_s2=1.5, half_track_m=0.1)
    assert ramp.step(rim_m_s, target_m_s, 0.1) == pytest.approx(next_m_s)


def test_monitor_includes_the_swing_while_braking() -> None:
    """It detects all points inside the real stopping motion; fading v and w alone misses some."""
    limits = SpeedLimits(latency_s=0.0)
    seeing = CollisionMonitor(CollisionMonitorOptions(), limits, Footprint(), SLOW)
    stiff = CollisionMonitor(
        CollisionMonitorOptions(),
        limits,
        Footprint(),
        WheelRamp(accel_m_s2=50.0, decel_m_s2=50.0, half_track_m=SLOW.half_track_m),
    )
    outline_m = Footprint().grown(-0.002).outline_m(0.02)
    missed = 0
    for pose in real_stop():
        for point_m in pose.apply(outline_m):
            if np.all(np.abs(point_m) < (0.24, 0.15)):
                continue  # under the robot at the start
            assert seeing.stop_reason(BEND, BEND, point_m[None, :], np.zeros(1), PERIOD_S)
            missed += not stiff.stop_reason(BEND, BEND, point_m[None, :], np.zeros(1), PERIOD_S)
    assert missed > 10


def real_stop() -> list[Pose2]:
    """Return a pose every 0.1 s of one period of the bend and of the wheels' ramps after it."""
    pose, step_s, poses = Pose2(), 1e-3, []
    for tick in range(math.ceil((PERIOD_S + SLOW.braking_s(BEND)) / step_s)):
        v, w = SLOW.braked(BEND, np.array([max(0.0, (tick + 0.5) * step_s - PERIOD_S)]))
        pose = pose @ Pose2(x_m=float(v[0]) * step_s, theta_rad=float(w[0]) * step_s)
        if tick % 100 == 99:
            poses.append(pose)
    return poses
