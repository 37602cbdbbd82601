"""Figures from the drive log: speed error and path length."""

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.runtime.drive_log import MAX_ROWS, DriveLog, path_length_m, speed_errors


def test_speed_error_is_setpoint_minus_measured() -> None:
    rows = np.zeros((4, 7))
    rows[:, 1], rows[:, 2] = [1, 1, 1, 1], [0, 2, 0, 2]  # left set-point, left measured
    rows[:, 4], rows[:, 5] = 3.0, 2.5
    errors = speed_errors(rows)
    assert (errors["left"].mean_rad_s, errors["left"].std_rad_s) == pytest.approx((0.0, 1.0))
    assert (errors["right"].mean_rad_s, errors["right"].std_rad_s) == pytest.approx((0.5, 0.0))


def test_path_length_adds_the_steps() -> None:
    assert path_length_m(np.array([[0, 0, 0, 0], [1, 3, 4, 0], [2, 3, 5, 9.0]])) == pytest.approx(6.0)


def test_a_long_patrol_does_not_fill_the_memory() -> None:
    log = DriveLog()
    for k in range(5 * MAX_ROWS):
        log.add_pose(0.1 * k, Pose2(x_m=float(k)))
    poses = log.poses
    assert MAX_ROWS / 2 <= len(poses) <= MAX_ROWS
    assert poses[0, 1] == 0.0
    assert poses[-1, 1] > 0.99 * 5 * MAX_ROWS
    assert len(set(np.diff(poses[:, 1]))) == 1  # evenly spread
