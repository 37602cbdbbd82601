"""Simulate many noisy command sequences, score them, and average them by their costs. Kernels."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.controllers.dwa_kernels import FRONT_M, Dynamics, MotionStart, distance_to_path
from thumper.navigation.costmap.footprint_collision import CollisionGrid, lethal_count

NoiseArray = NDArray[np.float32]
CHECK_EVERY = 2  # steps between two footprint checks: at most a cell apart
PATH_EVERY = 7  # steps between two distances from the path
OBSTACLE_DECAY_M = 0.08
NEGLIGIBLE_WEIGHT = 1e-4


class MppiTask(NamedTuple):
    """What all sequences of one cycle have in common."""

    start: MotionStart
    dynamics: Dynamics
    v_max: float
    w_max: float
    path_m: FloatArray  # shape (n, 2), the part of the path that counts
    inscribed_m: float  # inscribed radius of the footprint


class MppiWeights(NamedTuple):
    """Weights of the cost terms."""

    path: float  # mean distance from the path [1/m]
    goal: float  # distance left to the path's end [1/m]
    obstacle: float  # nearness to obstacles
    contact: float  # a contact, more if it is soon
    front: float  # distance of the front point from the path [1/m]


@kernel
def score_sequences(
    task: MppiTask, weights: MppiWeights, noise: NoiseArray, mean: FloatArray, grid: CollisionGrid
) -> FloatArray:
    """Return the cost of each command sequence, shape (k,).

    `mean`, shape (steps, 2), are the speeds (v, w) to which `noise`, shape (k, steps, 2), is added. On
    return `noise` holds the commanded speeds.
    """
    count, steps = noise.shape[0], noise.shape[1]
    totals = np.zeros(count)
    start, path_m = task.start, task.path_m
    step_s = task.dynamics.step_s
    dv, dw = task.dynamics.v_accel * step_s, task.dynamics.w_accel * step_s
    latency_steps = int(task.dynamics.latency_s / step_s)
    touching = max(0, lethal_count(grid, False, start.x, start.y, start.theta))
    origin_x, origin_y, resolution_m = grid.origin[0], grid.origin[1], grid.resolution
    rows, cols = grid.costs.shape
    end_x, end_y = path_m[-1, 0], path_m[-1, 1]
    for n in range(count):
        x, y, theta, v, w = start.x, start.y, start.theta, start.v, start.w
        total = 0.0
        for i in range(steps):
            wanted_v = min(max(mean[i, 0] + noise[n, i, 0], 0.0), task.v_max)
            wanted_w = min(max(mean[i, 1] + noise[n, i, 1], -task.w_max), task.w_max)
            if i >= latency_steps:
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
                    total += weights.contact * (steps - i) / steps
                    break
                squared = grid.squared_cells[row, col]
                if squared <= grid.safe_squared:
                    hits = lethal_count(grid, False, x, y, theta)
                    if hits < 0 or hits > touching:
                        total += weights.contact * (1.0 + (steps - i) / steps)
                        break
                    near_m = max(0.0, math.sqrt(squared) * resolution_m - task.inscribed_m)
                    total += weights.obstacle * math.exp(-near_m / OBSTACLE_DECAY_M) * CHECK_EVERY / steps
            if i % PATH_EVERY == PATH_EVERY - 1:
                total += weights.path * distance_to_path(path_m, x, y) * PATH_EVERY / steps
        total += weights.goal * math.hypot(x - end_x, y - end_y)
        front_x, front_y = x + FRONT_M * math.cos(theta), y + FRONT_M * math.sin(theta)
        total += weights.front * distance_to_path(path_m, front_x, front_y)
        totals[n] = total
    return totals


@kernel
def weighted_mean(commands: NoiseArray, totals: FloatArray, temperature: float) -> FloatArray:
    """Return the mean of command sequences, shape (steps, 2), each weighted by exp(-cost / temperature)."""
    least = totals.min()
    mean = np.zeros((commands.shape[1], 2))
    weight_sum = 0.0
    for n in range(totals.size):
        weight = math.exp(-(totals[n] - least) / temperature)
        if weight < NEGLIGIBLE_WEIGHT:
            continue
        weight_sum += weight
        for i in range(commands.shape[1]):
            mean[i, 0] += weight * commands[n, i, 0]
            mean[i, 1] += weight * commands[n, i, 1]
    return mean / weight_sum
