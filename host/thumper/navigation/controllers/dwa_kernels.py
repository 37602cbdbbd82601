"""Simulate many commands on the costmap and measure each. The controller's inner loop: kernels only."""

import math

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.costmap.footprint_collision import Ground, lethal_count

OPEN, HITS, LEAVES_MAP = 0, 1, 2
CLEARANCE, PATH, GOAL, FRONT, CUT = 0, 1, 2, 3, 4
SLIDE_POINTS = 2  # extra outline points that may touch on the way out of a contact


@kernel
def simulate(
    pose: FloatArray, twist: FloatArray, command: FloatArray, motion: FloatArray, poses: FloatArray
) -> None:
    """Fill `poses`, shape (steps, 3), with where a command leads from `pose` (x, y, theta) moving at `twist`
    (v, w).

    `motion` is (v_accel, w_accel, latency_s, step_s): the twist holds during the latency, then moves to the
    command at the accelerations. Each step is an arc driven at its mean heading.
    """
    x, y, theta = pose[0], pose[1], pose[2]
    v, w = twist[0], twist[1]
    step_s = motion[3]
    for i in range(poses.shape[0]):
        if (i + 0.5) * step_s > motion[2]:
            dv, dw = motion[0] * step_s, motion[1] * step_s
            v = min(max(command[0], v - dv), v + dv)
            w = min(max(command[1], w - dw), w + dw)
        x += v * step_s * math.cos(theta + 0.5 * w * step_s)
        y += v * step_s * math.sin(theta + 0.5 * w * step_s)
        theta += w * step_s
        poses[i, 0], poses[i, 1], poses[i, 2] = x, y, theta


@kernel
def first_contact(poses: FloatArray, ground: Ground, unknown_blocks: bool, touching: int) -> tuple[int, int]:
    """(status, step) of the first pose, shape (n, 3), whose outline meets an obstacle; (OPEN, n) if none
    does.

    `touching` is the number of outline points on obstacles in the pose the robot is in. A robot that touches
    already (a noisy cell, a graze) may slide along and move out, but must not end further in than it began.
    """
    allowed = touching + SLIDE_POINTS if touching > 0 else 0
    count = touching
    for i in range(poses.shape[0]):
        count = lethal_count(ground, unknown_blocks, poses[i, 0], poses[i, 1], poses[i, 2])
        if count < 0:
            return LEAVES_MAP, i
        if count > allowed:
            return HITS, i
    if count > touching:
        return HITS, poses.shape[0] - 1
    return OPEN, poses.shape[0]


@kernel
def distance_to_path(path_m: FloatArray, x: float, y: float) -> float:
    """Distance of a point to the nearest vertex of a path, shape (n, 2) [m]."""
    best = np.inf
    for i in range(path_m.shape[0]):
        best = min(best, (path_m[i, 0] - x) ** 2 + (path_m[i, 1] - y) ** 2)
    return math.sqrt(best)


@kernel
def measure(
    commands: FloatArray,
    pose: FloatArray,
    twist: FloatArray,
    motion: FloatArray,
    steps: int,
    ground: Ground,
    path_m: FloatArray,
    front_m: float,
    period_s: float,
) -> tuple[NDArray[np.int64], FloatArray]:
    """Roll out commands (v, w), shape (n, 2), over `steps` steps.

    A command is open when the robot can still stop before the contact: it drives on for the latency, one
    period and a step of reserve, and braking at constant deceleration takes half the way that driving on
    would. Its roll-out is cut off before the contact.

    Returns
    -------
    status : ndarray, shape (n,)
        OPEN, HITS (the outline meets an obstacle too soon) or LEAVES_MAP.
    terms : ndarray, shape (n, 5)
        Metres: least distance of the centre from an obstacle (CLEARANCE), mean distance from the path
        (PATH), distance of the last pose from the path's end (GOAL), distance of a point `front_m` ahead of
        it from the path (FRONT); and the part of the steps that a contact cuts off, 0 to 1 (CUT).
    """
    count = commands.shape[0]
    status = np.zeros(count, np.int64)
    terms = np.zeros((count, 5))
    poses = np.empty((steps, 3))
    touching = max(0, lethal_count(ground, False, pose[0], pose[1], pose[2]))
    origin_x, origin_y, resolution_m = ground.origin[0], ground.origin[1], ground.resolution
    end_x, end_y = path_m[-1, 0], path_m[-1, 1]
    for n in range(count):
        simulate(pose, twist, commands[n], motion, poses)
        status[n], free = first_contact(poses, ground, False, touching)
        if status[n] != OPEN:
            braking_s = max(abs(commands[n, 0]) / motion[0], abs(commands[n, 1]) / motion[1])
            if free * motion[3] < motion[2] + period_s + 0.5 * braking_s + motion[3]:
                continue
            status[n] = OPEN
        least = np.int32(2147483647)
        off_path = 0.0
        for i in range(free):
            col = math.floor((poses[i, 0] - origin_x) / resolution_m)
            row = math.floor((poses[i, 1] - origin_y) / resolution_m)
            least = min(least, ground.squared_cells[row, col])
            if i % 2 == 0:
                off_path += distance_to_path(path_m, poses[i, 0], poses[i, 1])
        x, y, theta = poses[free - 1]
        terms[n, CLEARANCE] = math.sqrt(least) * resolution_m
        terms[n, PATH] = off_path / ((free + 1) // 2)
        terms[n, GOAL] = math.hypot(x - end_x, y - end_y)
        terms[n, FRONT] = distance_to_path(
            path_m, x + front_m * math.cos(theta), y + front_m * math.sin(theta)
        )
        terms[n, CUT] = 1.0 - free / steps
    return status, terms
