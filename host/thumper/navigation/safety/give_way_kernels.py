"""Simulate plans of commands among predicted discs, and score each. Kernels.

Plans are the branches of a tree: those that begin alike share the simulation of what they have in common.
"""

import math
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.controllers.dwa_kernels import Dynamics, MotionStart
from thumper.navigation.costmap.footprint_collision import CollisionGrid, touches_more

AIM_GAIN = 1.5  # turn rate per angle to the aim [1/s]
AIM_TURN_RAD = 1.0  # further to the side the robot turns nearly on the spot ...
AIM_TURN_M_S = 0.1  # ... at this speed
AT_AIM_M = 0.3  # nearer than this the heading does not matter
GRAZE, DEEP_M = 0.2, 0.25  # the cost of a light touch, and the depth of a full one
AT_END = 0.2  # weight of a contact at the end of a plan, relative to one at once


class GiveWayWeights(NamedTuple):
    """Weights of the cost terms; costs are in metres of the path."""

    contact: float  # with a disc for a second, more if it is soon, or if the robot drives toward it
    near: float  # to a disc, within the margin, for a second
    static: float  # contact with an obstacle
    heading: float  # to the end of the path, per rad
    keep: float  # a plan is kept if another one is not better by more than this


class GiveWayTask(NamedTuple):
    """What all plans of one cycle have in common."""

    start: MotionStart
    sent: tuple[float, float]  # the command that the base obeys during the latency
    dynamics: Dynamics
    half_planes: FloatArray  # of the footprint, shape (k, 3)
    discs: FloatArray  # x, y, radius at each step, shape (steps, n, 3)
    margin_m: float  # kept from the discs now ...
    margin_m_s: float  # ... and more by this much per second
    path_m: FloatArray  # shape (n, 2), with few vertices
    left_m: FloatArray  # from each of them to the path's end, shape (n,)
    w_max: float
    grid: CollisionGrid
    touching: int  # so many points of the outline are on obstacles now
    weights: GiveWayWeights


class PlanMotion(NamedTuple):
    """The robot after some commands of a plan, and what the plan has cost so far."""

    x: float
    y: float
    theta: float
    v: float
    w: float
    cost: float  # infinite if the plan was given up
    ended: bool  # by a contact with a static obstacle


@kernel
def disc_clearance(
    half_planes: FloatArray,
    discs: FloatArray,
    step: int,
    pose: tuple[float, float, float, float],
    near: float,
) -> tuple[float, float]:
    """Return the footprint's least distance from the discs of a step, and the cosine of that disc's bearing.

    `discs` have the shape (steps, n, 3); `pose` is x, y, and cosine and sine of the heading. The distance of
    a corner is less than the true one. It is infinite if no disc is nearer than `near`.
    """
    x, y, cos, sin = pose
    least, ahead = np.inf, 0.0
    for n in range(discs.shape[1]):
        dx, dy = discs[step, n, 0] - x, discs[step, n, 1] - y
        bx, by = cos * dx + sin * dy, -sin * dx + cos * dy
        outside, enough = -np.inf, min(least, near) + discs[step, n, 2]
        for k in range(half_planes.shape[0]):
            outside = max(outside, half_planes[k, 0] * bx + half_planes[k, 1] * by - half_planes[k, 2])
            if outside >= enough:
                break
        if outside < enough:
            least, ahead = outside - discs[step, n, 2], bx / max(1e-6, math.hypot(bx, by))
    return least, ahead


@kernel
def first_conflict(half_planes: FloatArray, discs: FloatArray, margin_m: float, poses: FloatArray) -> int:
    """Return the first pose, shape (m, 3), within a margin of a disc, shape (m, n, 3); m if none is."""
    for i in range(poses.shape[0]):
        x, y, theta = poses[i]
        pose = (x, y, math.cos(theta), math.sin(theta))
        if disc_clearance(half_planes, discs, i, pose, margin_m)[0] < margin_m:
            return i
    return int(poses.shape[0])


@kernel
def angle_to(x: float, y: float, theta: float, aim_x: float, aim_y: float) -> float:
    """Return the angle from a heading at a place to another place, -pi to pi."""
    angle = math.atan2(aim_y - y, aim_x - x) - theta
    return angle - math.tau * math.floor((angle + math.pi) / math.tau)


@kernel
def toward_aim(angle: float, v: float, w_max: float) -> tuple[float, float]:
    """Return the speeds (v, w) of a turn toward an aim at an angle."""
    w = min(max(AIM_GAIN * angle, -w_max), w_max)
    return min(v, AIM_TURN_M_S) if abs(angle) > AIM_TURN_RAD else v, w


@kernel
def path_left(task: GiveWayTask, x: float, y: float) -> float:
    """Return the length from a place to the path's end, along the path from its best vertex."""
    least = np.inf
    for k in range(task.path_m.shape[0]):
        least = min(least, task.left_m[k] + math.hypot(task.path_m[k, 0] - x, task.path_m[k, 1] - y))
    return least


@kernel
def cost_to_go(task: GiveWayTask, x: float, y: float, theta: float) -> float:
    """Return the length of the path that is left at a pose, and the weighted angle to its end."""
    left = path_left(task, x, y)
    aim_x, aim_y = task.path_m[-1, 0], task.path_m[-1, 1]
    if math.hypot(aim_x - x, aim_y - y) > AT_AIM_M:
        left += task.weights.heading * abs(angle_to(x, y, theta, aim_x, aim_y))
    return left


@kernel
def moved_on(
    task: GiveWayTask,
    motion: PlanMotion,
    command: tuple[float, float],
    steps: tuple[int, int],
    limit: float,
) -> PlanMotion:
    """Return the motion after a command (v, w) from one step until another.

    With w = NaN the robot turns toward the end of the path. Backward it may not drive over unknown space.
    It is given up when it costs more than `limit`.
    """
    x, y, theta, v, w, total, ended = motion
    cos, sin = math.cos(theta), math.sin(theta)
    count, step_s = task.discs.shape[0], task.dynamics.step_s
    dv, dw = task.dynamics.v_accel * step_s, task.dynamics.w_accel * step_s
    late, aim_x, aim_y = round(task.dynamics.latency_s / step_s), task.path_m[-1, 0], task.path_m[-1, 1]
    for i in range(steps[0], steps[1]):
        wanted_v, wanted_w = command
        if i < late:
            wanted_v, wanted_w = task.sent
        elif math.isnan(wanted_w):
            wanted_v, wanted_w = toward_aim(angle_to(x, y, theta, aim_x, aim_y), wanted_v, task.w_max)
        v = min(max(wanted_v, v - dv), v + dv)
        w = min(max(wanted_w, w - dw), w + dw)
        theta += w * step_s
        old_cos, old_sin, cos, sin = cos, sin, math.cos(theta), math.sin(theta)
        x += 0.5 * v * step_s * (old_cos + cos)
        y += 0.5 * v * step_s * (old_sin + sin)
        sooner = 1.0 - i / count
        if i % 2 == 1 and touches_more(task.grid, v < 0.0, x, y, theta, task.touching):
            total += task.weights.static * (1.0 + sooner)
            ended = True
            break
        margin = task.margin_m + task.margin_m_s * i * step_s
        clear, ahead = disc_clearance(task.half_planes, task.discs, i, (x, y, cos, sin), margin)
        if clear < 0.0:  # it may be a mere graze, and who walks passes on
            deep = min(1.0, GRAZE + (1.0 - GRAZE) * -clear / DEEP_M)
            soon = AT_END + (1.0 - AT_END) * sooner
            total += task.weights.contact * step_s * deep * soon * (1.0 + 2.0 * max(0.0, v * ahead))
        elif clear < margin:
            total += task.weights.near * step_s * (1.0 - clear / margin) * (1.0 + sooner)
        if total > limit:
            total = np.inf
            break
    return PlanMotion(x, y, theta, v, w, total, ended)


@kernel
def score_plans(
    task: GiveWayTask,
    first: FloatArray,
    second: FloatArray,
    last: FloatArray,
    ends: tuple[int, int, int],
) -> FloatArray:
    """Return the cost of each plan, shape (len(first), len(second), len(last)).

    A plan is one command (v, w) of each set, shape (n, 2), until the step of `ends`. It ends at its first
    contact with a static obstacle. If a plan costs more than the best one with its first command by
    `keep`, its cost is infinite: its simulation stops early.
    """
    totals = np.full((len(first), len(second), len(last)), np.inf)
    start = task.start
    at_start = PlanMotion(start.x, start.y, start.theta, start.v, start.w, 0.0, False)
    fastest = max(np.abs(last[:, 0]).max(), abs(start.v))
    last_way = (ends[2] - ends[1]) * task.dynamics.step_s * fastest
    for a in range(len(first)):
        best, command = np.inf, (first[a, 0], first[a, 1])
        one = moved_on(task, at_start, command, (0, ends[0]), best)
        for b in range(len(second)):
            limit, command = best + task.weights.keep, (second[b, 0], second[b, 1])
            two = one
            if not one.ended:
                two = moved_on(task, one, command, (ends[0], ends[1]), limit)
            # So much the last command cannot save.
            least_left = max(0.0, path_left(task, two.x, two.y) - last_way)
            if two.cost + least_left > limit:
                continue
            for c in range(len(last)):
                limit, command = best + task.weights.keep - least_left, (last[c, 0], last[c, 1])
                three = two
                if not two.ended:
                    three = moved_on(task, two, command, (ends[1], ends[2]), limit)
                totals[a, b, c] = three.cost + cost_to_go(task, three.x, three.y, three.theta)
                best = min(best, totals[a, b, c])
    return totals
