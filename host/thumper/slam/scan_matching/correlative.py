"""Correlative scan matching in a window of poses, for odometry errors beyond Gauss-Newton's basin.

The plain form of Olson, "Real-time correlative scan matching", ICRA 2009: every pose of the window is scored.
"""

import math
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.slam.scan_matching.distance_field import MetricField, distance_at, field_shape
from thumper.slam.scan_matching.gauss_newton import score


class SearchWindow(NamedTuple):
    """Half sides of a window of poses, and the steps within it."""

    half_m: float
    half_rad: float
    step_m: float
    step_rad: float


@kernel
def correlative_search(
    points_m: FloatArray, centre: FloatArray, window: SearchWindow, field: MetricField, std_m: float
) -> FloatArray:
    """Return the pose (x, y, theta) of the best mean likelihood in the window around `centre`, shape (3,).

    A pose at the edge of the window must explain 0.1 more of the beams than the centre: the penalty grows
    with the square of the offset. The steps are whole cells.
    """
    (rows, cols), resolution_m, n = field_shape(field), field.resolution_m, points_m.shape[0]
    step = round(window.step_m / resolution_m)
    step_m = step * resolution_m
    n_xy = math.ceil(window.half_m / step_m)
    n_theta = math.ceil(window.half_rad / window.step_rad)
    cells = np.empty((n, 2), dtype=np.int32)
    best, best_score = centre.copy(), -1.0
    for k in range(-n_theta, n_theta + 1):
        theta = centre[2] + k * window.step_rad
        cos, sin = math.cos(theta), math.sin(theta)
        for i in range(n):
            cells[i, 0] = math.floor((centre[1] + sin * points_m[i, 0] + cos * points_m[i, 1]) / resolution_m)
            cells[i, 1] = math.floor((centre[0] + cos * points_m[i, 0] - sin * points_m[i, 1]) / resolution_m)
        for dy in range(-n_xy, n_xy + 1):
            for dx in range(-n_xy, n_xy + 1):
                offset = (dx * dx + dy * dy) / (n_xy * n_xy) + k * k / max(1, n_theta * n_theta)
                missing, most_missing = 0.0, n * (1.0 - best_score - 0.1 * offset)
                for i in range(n):
                    row, col = cells[i, 0] + dy * step, cells[i, 1] + dx * step
                    likelihood = 0.0
                    if 0 <= col < cols and 0 <= row < rows:
                        d_m = distance_at(field, row, col)
                        if d_m < field.max_distance_m:
                            likelihood = math.exp(-0.5 * (d_m / std_m) ** 2)
                    missing += 1.0 - likelihood
                    if missing > most_missing:
                        break  # the beams left cannot make it the best
                candidate = 1.0 - missing / n - 0.1 * offset
                if candidate > best_score:
                    best_score = candidate
                    best[0], best[1] = centre[0] + dx * step_m, centre[1] + dy * step_m
                    best[2] = theta
    return best


@kernel
def heading_search(
    points_m: FloatArray, centre: FloatArray, window: SearchWindow, field: MetricField, std_m: float
) -> FloatArray:
    """Return the pose of the best mean likelihood among headings around `centre`, shape (3,).

    The position stays; of `window` only the angles count.
    """
    trial, best, best_score = centre.copy(), centre.copy(), -1.0
    n = math.ceil(window.half_rad / window.step_rad)
    for k in range(-n, n + 1):
        trial[2] = centre[2] + k * window.step_rad
        candidate = score(points_m, trial, field, std_m)
        if candidate > best_score:
            best_score = candidate
            best[:] = trial
    return best
