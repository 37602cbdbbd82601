"""Slip is counted where wheels and scans disagree, and only there."""

import pytest

from thumper.common.geometry import Pose2
from thumper.odometry.slip_detector import SlipDetector


def run(wheels: Pose2, scans: Pose2, steps: int) -> SlipDetector:
    """Return the detector after `steps` with these motions per step."""
    detector, odom, true = SlipDetector(), Pose2(x_m=3.0, theta_rad=1.0), Pose2()
    for _ in range(steps):
        detector.update(odom, true)
        odom, true = odom @ wheels, true @ scans
    return detector


@pytest.mark.parametrize(("long", "wide"), [(1.0, 1.0), (1.1, 1.15), (0.9, 0.85)])
def test_slightly_wrong_wheels_do_not_slip(long: float, wide: float) -> None:
    scans = Pose2(x_m=0.03, theta_rad=0.04)
    detector = run(Pose2(x_m=0.03 * long, theta_rad=0.04 * wide), scans, 300)
    assert detector.slips == 0
    assert detector.summary_lines() == []


def test_spinning_wheels_of_a_stationary_robot_are_counted() -> None:
    detector = run(Pose2(x_m=0.04), Pose2(), 34)  # four segments; the last one waits for the next
    assert detector.slips == 3
    assert detector.worst_m == pytest.approx(0.64)
    assert detector.summary_lines()[0].startswith(
        "wheels and scans disagreed 3 times, by up to 0.64 m and 0 deg"
    )


def test_a_pushed_or_turned_robot_is_counted() -> None:
    assert run(Pose2(), Pose2(x_m=0.05), 14).slips == 1
    assert run(Pose2(theta_rad=0.01), Pose2(theta_rad=0.06), 20).slips == 1


def test_one_slip_in_a_straight_drive_is_counted_once() -> None:
    detector, odom = SlipDetector(), Pose2()
    for k in range(60):
        detector.update(odom, Pose2(x_m=0.05 * k))
        odom = odom @ Pose2(x_m=0.05, theta_rad=0.2 if k == 20 else 0.0)
    assert detector.slips == 1


@pytest.mark.parametrize("wrong", [Pose2(x_m=0.2), Pose2(y_m=-0.2), Pose2(theta_rad=0.3)])
def test_a_briefly_wrong_match_is_no_slip(wrong: Pose2) -> None:
    detector = SlipDetector()
    for k in range(60):
        true = Pose2(x_m=0.05 * k)
        detector.update(true, true @ wrong if 20 <= k < 27 else true)
    assert detector.slips == 0


def test_motion_before_a_reset_does_not_count() -> None:
    detector = SlipDetector()
    detector.update(Pose2(), Pose2())
    detector.reset()
    detector.update(Pose2(x_m=5.0), Pose2())
    assert not detector.update(Pose2(x_m=5.4), Pose2(x_m=0.4))
    assert detector.slips == 0
