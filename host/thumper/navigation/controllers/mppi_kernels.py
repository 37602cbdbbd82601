"""Many noisy futures, their costs, and the mean that the cheap ones vote for. Kernels."""

import math

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.controllers.dwa_kernels import distance_to_path
from thumper.navigation.costmap.footprint_collision import Ground, lethal_count

NoiseArray = NDArray[np.float32]
CHECK_EVERY = 2  # steps between two footprint checks: at most a cell apart
PATH_EVERY = 7  # steps between two distances from the path


@kernel
def score_futures(
    noise: NoiseArray,
    mean: FloatArray,
    state: FloatArray,
    limits: FloatArray,
    ground: Ground,
    path_m: FloatArray,
    weights: FloatArray,
    inscribed_m: float,
) -> FloatArray:
    """Cost of each future, shape (k,); `noise`, shape (k, steps, 2), becomes the speeds that were driven.

    Parameters
    ----------
    mean : ndarray, shape (steps, 2)
        Speeds (v, w) that the noise is added to.
    state : ndarray, shape (5,)
        x, y, theta, v, w at the beginning.
    limits : ndarray, shape (6,)
        v_max, w_max, v_accel, w_accel, latency_s, step_s.
    weights : ndarray, shape (5,)
        Path, goal, obstacle, contact and heading weight.
    """
    count, steps = noise.shape[0], noise.shape[1]
    totals = np.zeros(count)
    step_s = limits[5]
    dv, dw = limits[2] * step_s, limits[3] * step_s
    blind = int(limits[4] / step_s)
    touching = max(0, lethal_count(ground, False, state[0], state[1], state[2]))
    origin_x, origin_y, resolution_m = ground.origin[0], ground.origin[1], ground.resolution
    rows, cols = ground.costs.shape
    end_x, end_y = path_m[-1, 0], path_m[-1, 1]
    for n in range(count):
        x, y, theta, v, w = state[0], state[1], state[2], state[3], state[4]
        total = 0.0
        for i in range(steps):
            wanted_v = min(max(mean[i, 0] + noise[n, i, 0], 0.0), limits[0])
            wanted_w = min(max(mean[i, 1] + noise[n, i, 1], -limits[1]), limits[1])
            if i >= blind:
                v = min(max(wanted_v, v - dv), v + dv)
                w = min(max(wanted_w, w - dw), w + dw)
            noise[n, i, 0], noise[n, i, 1] = wanted_v, wanted_w
            x += v * step_s * math.cos(theta)
            y += v * step_s * math.sin(theta)
            theta += w * step_s
            if i % CHECK_EVERY == 0:
                col = math.floor((x - origin_x) / resolution_m)
                row = math.floor((y - origin_y) / resolution_m)
                if row < 0 or col < 0 or row >= rows or col >= cols:
                    total += weights[3] * (steps - i) / steps
                    break
                squared = ground.squared_cells[row, col]
                if squared <= ground.safe_squared:
                    meets = lethal_count(ground, False, x, y, theta)
                    if meets < 0 or meets > touching:
                        total += weights[3] * (1.0 + (steps - i) / steps)
                        break
                    near_m = max(0.0, math.sqrt(squared) * resolution_m - inscribed_m)
                    total += weights[2] * math.exp(-near_m / 0.08) * CHECK_EVERY / steps
            if i % PATH_EVERY == PATH_EVERY - 1:
                total += weights[0] * distance_to_path(path_m, x, y) * PATH_EVERY / steps
        total += weights[1] * math.hypot(x - end_x, y - end_y)
        front_x, front_y = x + 0.25 * math.cos(theta), y + 0.25 * math.sin(theta)
        total += weights[4] * distance_to_path(path_m, front_x, front_y)
        totals[n] = total
    return totals


@kernel
def weighted_mean(driven: NoiseArray, totals: FloatArray, temperature: float) -> FloatArray:
    """Mean of the futures' speeds, shape (steps, 2), each weighted by exp(-cost / temperature)."""
    least = totals.min()
    mean = np.zeros((driven.shape[1], 2))
    mass = 0.0
    for n in range(totals.size):
        weight = math.exp(-(totals[n] - least) / temperature)
        if weight < 1e-4:
            continue
        mass += weight
        for i in range(driven.shape[1]):
            mean[i, 0] += weight * driven[n, i, 0]
            mean[i, 1] += weight * driven[n, i, 1]
    return mean / mass
