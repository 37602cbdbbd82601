"""Slip is counted where wheels and scans disagree, and nowhere else."""

import pytest

from thumper.common.geometry import Pose2
from thumper.odometry.slip_detector import SlipDetector


def watched(wheels: Pose2, scans: Pose2, steps: int) -> SlipDetector:
    watch, odom, true = SlipDetector(), Pose2(x_m=3.0, theta_rad=1.0), Pose2()
    for _ in range(steps):
        watch.update(odom, true)
        odom, true = odom @ wheels, true @ scans
    return watch


@pytest.mark.parametrize(("long", "wide"), [(1.0, 1.0), (1.1, 1.15), (0.9, 0.85)])
def test_wheels_that_are_a_little_off_do_not_slip(long: float, wide: float) -> None:
    scans = Pose2(x_m=0.03, theta_rad=0.04)
    watch = watched(Pose2(x_m=0.03 * long, theta_rad=0.04 * wide), scans, 300)
    assert watch.slips == 0
    assert watch.summary_lines() == []


def test_wheels_that_spin_on_the_spot_are_counted() -> None:
    watch = watched(Pose2(x_m=0.04), Pose2(), 34)  # four stretches; the last one waits for the next
    assert watch.slips == 3
    assert watch.worst_m == pytest.approx(0.64)
    assert watch.summary_lines()[0].startswith(
        "3 times the wheels and the scans disagreed, by up to 0.64 m and 0 deg"
    )


def test_a_robot_that_is_pushed_or_turned_by_hand_is_counted() -> None:
    assert watched(Pose2(), Pose2(x_m=0.05), 14).slips == 1
    assert watched(Pose2(theta_rad=0.01), Pose2(theta_rad=0.06), 20).slips == 1


def test_one_slip_in_a_straight_drive_is_counted_once() -> None:
    watch, odom = SlipDetector(), Pose2()
    for k in range(60):
        watch.update(odom, Pose2(x_m=0.05 * k))
        odom = odom @ Pose2(x_m=0.05, theta_rad=0.2 if k == 20 else 0.0)
    assert watch.slips == 1


@pytest.mark.parametrize("wrong", [Pose2(x_m=0.2), Pose2(y_m=-0.2), Pose2(theta_rad=0.3)])
def test_a_match_that_was_off_for_a_moment_is_no_slip(wrong: Pose2) -> None:
    watch = SlipDetector()
    for k in range(60):
        true = Pose2(x_m=0.05 * k)
        watch.update(true, true @ wrong if 20 <= k < 27 else true)
    assert watch.slips == 0


def test_what_happened_while_the_scans_said_nothing_does_not_count() -> None:
    watch = SlipDetector()
    watch.update(Pose2(), Pose2())
    watch.reset()
    watch.update(Pose2(x_m=5.0), Pose2())
    assert not watch.update(Pose2(x_m=5.4), Pose2(x_m=0.4))
    assert watch.slips == 0
