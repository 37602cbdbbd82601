"""Simulate many commands on the costmap and score each. The inner loop of the DWA controller: kernels."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.costmap.footprint_collision import CollisionGrid, lethal_count

FREE, HITS_OBSTACLE, LEAVES_MAP = 0, 1, 2
CLEARANCE, PATH, GOAL, FRONT, CUT = 0, 1, 2, 3, 4
SLIDE_POINTS = 2  # extra outline points that may touch while the robot leaves a contact
ARRIVED_M = 0.1  # a rollout that comes nearer to the path's end passes it
FRONT_M = 0.25  # a point this far ahead of the robot keeps it pointing along the path


class MotionStart(NamedTuple):
    """Pose and twist from which a motion is simulated."""

    x: float
    y: float
    theta: float
    v: float
    w: float


class Dynamics(NamedTuple):
    """How the base obeys a command."""

    v_accel: float  # [m/s^2]
    w_accel: float  # [rad/s^2]
    latency_s: float
    step_s: float  # of the simulation


class RolloutTask(NamedTuple):
    """What all commands of one cycle have in common."""

    start: MotionStart
    dynamics: Dynamics
    steps: int
    period_s: float
    path_m: FloatArray  # shape (n, 2), the part of the path that counts
    arrives: bool  # its end is that of the whole path: a rollout that passes it has arrived there


@kernel
def simulate(start: MotionStart, command: FloatArray, dynamics: Dynamics, poses: FloatArray) -> None:
    """Fill `poses`, shape (steps, 3), with the motion that a command (v, w) causes.

    The twist holds during the latency, then changes to the command at the accelerations. Each step is an arc
    driven at its mean heading.
    """
    x, y, theta = start.x, start.y, start.theta
    v, w = start.v, start.w
    step_s = dynamics.step_s
    for i in range(poses.shape[0]):
        if (i + 0.5) * step_s > dynamics.latency_s:
            dv, dw = dynamics.v_accel * step_s, dynamics.w_accel * step_s
            v = min(max(command[0], v - dv), v + dv)
            w = min(max(command[1], w - dw), w + dw)
        x += v * step_s * math.cos(theta + 0.5 * w * step_s)
        y += v * step_s * math.sin(theta + 0.5 * w * step_s)
        theta += w * step_s
        poses[i, 0], poses[i, 1], poses[i, 2] = x, y, theta


@kernel
def first_contact(
    poses: FloatArray, grid: CollisionGrid, unknown_blocks: bool, touching: int
) -> tuple[int, int]:
    """Return (status, step) of the first pose, shape (n, 3), that meets an obstacle, or (FREE, n).

    `touching` is the number of outline points on obstacles at the robot's pose. A robot that touches already
    (a noisy cell, a graze) may slide along and move out, but must not end deeper than it began.
    """
    allowed = touching + SLIDE_POINTS if touching > 0 else 0
    count = touching
    for i in range(poses.shape[0]):
        count = lethal_count(grid, unknown_blocks, poses[i, 0], poses[i, 1], poses[i, 2])
        if count < 0:
            return LEAVES_MAP, i
        if count > allowed:
            return HITS_OBSTACLE, i
    if count > touching:
        return HITS_OBSTACLE, poses.shape[0] - 1
    return FREE, poses.shape[0]


@kernel
def distance_to_path(path_m: FloatArray, x: float, y: float) -> float:
    """Return the distance from a point to the nearest vertex of a path, shape (n, 2) [m]."""
    best = np.inf
    for i in range(path_m.shape[0]):
        best = min(best, (path_m[i, 0] - x) ** 2 + (path_m[i, 1] - y) ** 2)
    return math.sqrt(best)


@kernel
def arrival(poses: FloatArray, end_x: float, end_y: float) -> int:
    """Return the pose, of shape (n, 3), nearest to the path's end if the motion passes it; else the last."""
    nearest, least = poses.shape[0] - 1, ARRIVED_M
    for i in range(poses.shape[0]):
        distance = math.hypot(poses[i, 0] - end_x, poses[i, 1] - end_y)
        if distance < least:
            nearest, least = i, distance
    return int(nearest)


@kernel
def score_commands(
    task: RolloutTask, commands: FloatArray, grid: CollisionGrid
) -> tuple[NDArray[np.int64], FloatArray]:
    """Simulate commands (v, w), shape (n, 2), and compute the terms of their scores.

    A command is admissible if the robot can still stop before the contact: it drives on for the latency, one
    period and one reserve step, and braking at constant deceleration takes half the distance that driving on
    would. Its rollout ends before the contact.

    A rollout that passes the end of the whole path is compared with the path only up to there: the speed
    limit lets the robot brake in time. What it drives beyond is a gain, else the robot would creep there.

    Returns
    -------
    status : ndarray, shape (n,)
        FREE, HITS_OBSTACLE (the outline meets an obstacle too soon) or LEAVES_MAP.
    terms : ndarray, shape (n, 5)
        In metres: least distance of the centre from an obstacle (CLEARANCE), mean distance from the path
        (PATH), distance of the last pose from the path's end, negative beyond it (GOAL), distance of a point
        `FRONT_M` ahead of it from the path (FRONT). Then the fraction of the steps that a contact cuts off
        (CUT).
    """
    start, dynamics, steps, path_m = task.start, task.dynamics, task.steps, task.path_m
    count = commands.shape[0]
    status = np.zeros(count, np.int64)
    terms = np.zeros((count, 5))
    poses, off_path = np.empty((steps, 3)), np.empty((steps + 1) // 2)  # summed up from the start
    touching = max(0, lethal_count(grid, False, start.x, start.y, start.theta))
    origin_x, origin_y, resolution_m = grid.origin[0], grid.origin[1], grid.resolution
    end_x, end_y = path_m[-1, 0], path_m[-1, 1]
    for n in range(count):
        simulate(start, commands[n], dynamics, poses)
        status[n], free = first_contact(poses, grid, False, touching)
        if status[n] != FREE:
            braking_s = max(abs(commands[n, 0]) / dynamics.v_accel, abs(commands[n, 1]) / dynamics.w_accel)
            needed_s = dynamics.latency_s + task.period_s + 0.5 * braking_s + dynamics.step_s
            if free * dynamics.step_s < needed_s:
                continue
            status[n] = FREE
        least = np.int32(2147483647)
        off_path[0] = 0.0
        for i in range(free):
            col = math.floor((poses[i, 0] - origin_x) / resolution_m)
            row = math.floor((poses[i, 1] - origin_y) / resolution_m)
            least = min(least, grid.squared_cells[row, col])
            if i % 2 == 0:
                off_path[i // 2] = distance_to_path(path_m, poses[i, 0], poses[i, 1])
                if i > 0:
                    off_path[i // 2] += off_path[i // 2 - 1]
        last = arrival(poses[:free], end_x, end_y) if task.arrives else free - 1
        x, y, theta = poses[last]
        terms[n, CLEARANCE] = math.sqrt(least) * resolution_m
        terms[n, PATH] = off_path[last // 2] / (last // 2 + 1)
        beyond = math.hypot(poses[free - 1, 0] - x, poses[free - 1, 1] - y)
        terms[n, GOAL] = math.hypot(x - end_x, y - end_y) - beyond
        terms[n, FRONT] = distance_to_path(
            path_m, x + FRONT_M * math.cos(theta), y + FRONT_M * math.sin(theta)
        )
        terms[n, CUT] = 1.0 - free / steps
    return status, terms
