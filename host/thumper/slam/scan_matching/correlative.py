"""Search of a window of poses on a grid, for when odometry has slipped too far for Gauss-Newton.

The plain form of Olson, "Real-time correlative scan matching", ICRA 2009: every pose of the window is scored.
"""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.slam.scan_matching.distance_field import FieldArray
from thumper.slam.scan_matching.gauss_newton import score


@kernel
def correlative_search(
    points_m: FloatArray,
    centre: FloatArray,
    window_m: float,
    window_rad: float,
    step_m: float,
    step_rad: float,
    distance_m: FieldArray,
    resolution_m: float,
    reach_m: float,
    std_m: float,
) -> FloatArray:
    """Return the pose (x, y, theta), shape (3,), of the best mean likelihood within +- window of `centre`.

    A pose at the window's edge is taken only if it explains a tenth of the beams more than the centre would:
    the penalty grows with the square of the offset.
    """
    n_xy, n_theta = math.ceil(window_m / step_m), math.ceil(window_rad / step_rad)
    rotated = np.empty_like(points_m)
    best, best_score = centre.copy(), -1.0
    for k in range(-n_theta, n_theta + 1):
        theta = centre[2] + k * step_rad
        cos, sin = math.cos(theta), math.sin(theta)
        for i in range(points_m.shape[0]):
            rotated[i, 0] = (centre[0] + cos * points_m[i, 0] - sin * points_m[i, 1]) / resolution_m
            rotated[i, 1] = (centre[1] + sin * points_m[i, 0] + cos * points_m[i, 1]) / resolution_m
        for dy in range(-n_xy, n_xy + 1):
            for dx in range(-n_xy, n_xy + 1):
                total = 0.0
                for i in range(points_m.shape[0]):
                    col = math.floor(rotated[i, 0] + dx * step_m / resolution_m)
                    row = math.floor(rotated[i, 1] + dy * step_m / resolution_m)
                    if 0 <= col < distance_m.shape[1] and 0 <= row < distance_m.shape[0]:
                        d_m = distance_m[row, col]
                        if d_m < reach_m:
                            total += math.exp(-0.5 * (d_m / std_m) ** 2)
                offset = (dx * dx + dy * dy) / (n_xy * n_xy) + k * k / (n_theta * n_theta)
                candidate = total / points_m.shape[0] - 0.1 * offset
                if candidate > best_score:
                    best_score = candidate
                    best[0], best[1] = centre[0] + dx * step_m, centre[1] + dy * step_m
                    best[2] = theta
    return best


@kernel
def heading_search(
    points_m: FloatArray,
    centre: FloatArray,
    window_rad: float,
    step_rad: float,
    distance_m: FieldArray,
    resolution_m: float,
    reach_m: float,
    std_m: float,
) -> FloatArray:
    """Return the pose, shape (3,), of the best mean likelihood of those turned from `centre` on the spot."""
    trial, best, best_score = centre.copy(), centre.copy(), -1.0
    n = math.ceil(window_rad / step_rad)
    for k in range(-n, n + 1):
        trial[2] = centre[2] + k * step_rad
        candidate = score(points_m, trial, distance_m, resolution_m, reach_m, std_m)
        if candidate > best_score:
            best_score = candidate
            best[:] = trial
    return best
