"""Many poses at once, as rows x, y, theta."""

import math

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, wrap_angle


def compose_rows(first: FloatArray, second: FloatArray) -> FloatArray:
    """Compose poses row by row, shapes (n, 3); headings of the result are in [-pi, pi)."""
    cos, sin = np.cos(first[:, 2]), np.sin(first[:, 2])
    theta_rad = first[:, 2] + second[:, 2]
    return np.column_stack(
        (
            first[:, 0] + cos * second[:, 0] - sin * second[:, 1],
            first[:, 1] + sin * second[:, 0] + cos * second[:, 1],
            np.remainder(theta_rad + math.pi, math.tau) - math.pi,
        )
    )


def to_pose(row: FloatArray) -> Pose2:
    """Return a row x, y, theta as a pose."""
    return Pose2(x_m=float(row[0]), y_m=float(row[1]), theta_rad=wrap_angle(float(row[2])))


def compose(poses: FloatArray, step: Pose2) -> FloatArray:
    """Move every pose, shape (n, 3), by the same step in its own frame; headings are not wrapped."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.column_stack(
        (
            poses[:, 0] + cos * step.x_m - sin * step.y_m,
            poses[:, 1] + sin * step.x_m + cos * step.y_m,
            poses[:, 2] + step.theta_rad,
        )
    )
