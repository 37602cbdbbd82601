"""Many poses at once, as rows x, y, theta."""

import math

import numpy as np

from thumper.common.geometry import FloatArray


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
