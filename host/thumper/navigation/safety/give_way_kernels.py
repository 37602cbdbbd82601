"""Simulate plans of commands among predicted discs, and score each. Kernels."""

import math
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.controllers.dwa_kernels import Dynamics, MotionStart
from thumper.navigation.costmap.footprint_collision import CollisionGrid, lethal_count

AIM_GAIN = 1.5  # turn rate per angle to the aim [1/s]
AIM_TURN_RAD = 1.0  # further to the side the robot turns nearly on the spot ...
AIM_TURN_M_S = 0.1  # ... at this speed
AT_AIM_M = 0.3  # nearer than this the heading does not matter
GRAZE, DEEP_M = 0.2, 0.25  # the cost of a light touch, and the depth of a full one
AT_END = 0.2  # weight of a contact at the end of a plan, relative to one at once


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


class GiveWayWeights(NamedTuple):
    """Weights of the cost terms; costs are in metres of the path."""

    contact: float  # with a disc for a second, more if it is soon, or if the robot drives toward it
    near: float  # to a disc, within the margin, for a second
    static: float  # contact with an obstacle
    heading: float  # to the end of the path, per rad
    keep: float  # a plan is kept if another one is not better by more than this


@kernel
def disc_clearance(
    half_planes: FloatArray, discs: FloatArray, step: int, pose: tuple[float, float, float, float]
) -> tuple[float, float]:
    """Return the footprint's least distance from the discs of a step, and the cosine of that disc's bearing.

    `discs` have the shape (steps, n, 3); `pose` is x, y, and cosine and sine of the heading. The distance of
    a corner is less than the true one.
    """
    x, y, cos, sin = pose
    least, ahead = np.inf, 0.0
    for n in range(discs.shape[1]):
        dx, dy = discs[step, n, 0] - x, discs[step, n, 1] - y
        bx, by = cos * dx + sin * dy, -sin * dx + cos * dy
        outside = -np.inf
        for k in range(half_planes.shape[0]):
            outside = max(outside, half_planes[k, 0] * bx + half_planes[k, 1] * by - half_planes[k, 2])
        if outside - discs[step, n, 2] < least:
            least, ahead = outside - discs[step, n, 2], bx / max(1e-6, math.hypot(bx, by))
    return least, ahead


@kernel
def first_conflict(half_planes: FloatArray, discs: FloatArray, margin_m: float, poses: FloatArray) -> int:
    """Return the first pose, shape (m, 3), within a margin of a disc, shape (m, n, 3); m if none is."""
    for i in range(poses.shape[0]):
        x, y, theta = poses[i]
        if disc_clearance(half_planes, discs, i, (x, y, math.cos(theta), math.sin(theta)))[0] < margin_m:
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
def cost_to_go(task: GiveWayTask, weights: GiveWayWeights, x: float, y: float, theta: float) -> float:
    """Return the length of the path that is left at a pose, and the weighted angle to its end."""
    least = np.inf
    for k in range(task.path_m.shape[0]):
        least = min(least, task.left_m[k] + math.hypot(task.path_m[k, 0] - x, task.path_m[k, 1] - y))
    aim_x, aim_y = task.path_m[-1, 0], task.path_m[-1, 1]
    if math.hypot(aim_x - x, aim_y - y) > AT_AIM_M:
        least += weights.heading * abs(angle_to(x, y, theta, aim_x, aim_y))
    return least


@kernel
def score_plans(
    task: GiveWayTask, plans: FloatArray, ends: FloatArray, grid: CollisionGrid, weights: GiveWayWeights
) -> FloatArray:
    """Return the cost of each plan, shape (n,), of commands (v, w), shape (n, segments, 2).

    Plans with the same first command must follow one another. If one of them costs more than the best of
    them by `weights.keep`, its cost is infinite: the simulation stops early.

    `ends`, shape (segments,), are the steps at which the commands end. With w = NaN the robot turns toward
    the end of the path. A plan ends at its first contact with a static obstacle. Backward it may not drive
    over unknown space.
    """
    start, steps, step_s = task.start, task.discs.shape[0], task.dynamics.step_s
    totals = np.zeros(plans.shape[0])
    dv, dw = task.dynamics.v_accel * step_s, task.dynamics.w_accel * step_s
    (sent_v, sent_w), w_max, late = task.sent, task.w_max, round(task.dynamics.latency_s / step_s)
    half_planes, discs, aim_x, aim_y = task.half_planes, task.discs, task.path_m[-1, 0], task.path_m[-1, 1]
    touching = max(0, lethal_count(grid, False, start.x, start.y, start.theta))
    best = np.inf
    for n in range(plans.shape[0]):
        if n > 0 and (plans[n, 0, 0] != plans[n - 1, 0, 0] or plans[n, 0, 1] != plans[n - 1, 0, 1]):
            best = np.inf
        x, y, theta, v, w = start.x, start.y, start.theta, start.v, start.w
        cos, sin, total, segment = math.cos(theta), math.sin(theta), 0.0, 0
        for i in range(steps):
            while segment < ends.size - 1 and i >= ends[segment]:
                segment += 1
            wanted_v, wanted_w = plans[n, segment, 0], plans[n, segment, 1]
            if i < late:
                wanted_v, wanted_w = sent_v, sent_w
            elif math.isnan(wanted_w):
                wanted_v, wanted_w = toward_aim(angle_to(x, y, theta, aim_x, aim_y), wanted_v, w_max)
            v = min(max(wanted_v, v - dv), v + dv)
            w = min(max(wanted_w, w - dw), w + dw)
            theta += w * step_s
            old_cos, old_sin, cos, sin = cos, sin, math.cos(theta), math.sin(theta)
            x += 0.5 * v * step_s * (old_cos + cos)
            y += 0.5 * v * step_s * (old_sin + sin)
            sooner = 1.0 - i / steps
            if i % 2 == 1:
                hits = lethal_count(grid, v < 0.0, x, y, theta)
                if hits < 0 or hits > touching:
                    total += weights.static * (1.0 + sooner)
                    break
            margin = task.margin_m + task.margin_m_s * i * step_s
            clear, ahead = disc_clearance(half_planes, discs, i, (x, y, cos, sin))
            if clear < 0.0:  # it may be a mere graze, and who walks passes on
                deep = min(1.0, GRAZE + (1.0 - GRAZE) * -clear / DEEP_M)
                soon = AT_END + (1.0 - AT_END) * sooner
                total += weights.contact * step_s * deep * soon * (1.0 + 2.0 * max(0.0, v * ahead))
            elif clear < margin:
                total += weights.near * step_s * (1.0 - clear / margin) * (1.0 + sooner)
            if total > best + weights.keep:
                total = np.inf
                break
        totals[n] = total + cost_to_go(task, weights, x, y, theta)
        best = min(best, totals[n])
    return totals
