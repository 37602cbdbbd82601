"""Scan matching inside each particle's own map, and what the match says about the particle.

The matched pose is the mode of beams times odometry, the inverse of the Gauss-Newton matrix its
covariance: the Gaussian that Grisetti, Stachniss and Burgard sample their improved proposal from
("Improved techniques for
grid mapping with Rao-Blackwellized particle filters", IEEE T-RO 23(1), 2007), found without their samples.
"""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.slam.particle_filter.patches import FAR, MASK, SIDE_BITS, IndexArray
from thumper.slam.scan_matching.distance_field import ByteArray
from thumper.slam.scan_matching.linalg3 import solve3, spread3

TINY = 1e-12


@kernel
def _level(table: IndexArray, near: ByteArray, row: int, col: int) -> float:
    return float(near[table[row >> SIDE_BITS, col >> SIDE_BITS], row & MASK, col & MASK])


@kernel
def _look(table: IndexArray, near: ByteArray, x: float, y: float) -> tuple[float, float, float]:
    """Bilinear level and its slopes along x and y a cell at a point in cells."""
    u, v = x - 0.5, y - 0.5
    c, r = math.floor(u), math.floor(v)
    if c < 0 or r < 0 or c + 1 >= table.shape[1] << SIDE_BITS or r + 1 >= table.shape[0] << SIDE_BITS:
        return float(FAR), 0.0, 0.0
    rr, cc = r & MASK, c & MASK
    if rr < MASK and cc < MASK:
        patch = near[table[r >> SIDE_BITS, c >> SIDE_BITS]]
        d00, d01 = float(patch[rr, cc]), float(patch[rr, cc + 1])
        d10, d11 = float(patch[rr + 1, cc]), float(patch[rr + 1, cc + 1])
    else:
        d00, d01 = _level(table, near, r, c), _level(table, near, r, c + 1)
        d10, d11 = _level(table, near, r + 1, c), _level(table, near, r + 1, c + 1)
    fu, fv = u - c, v - r
    low, high = d00 + fu * (d01 - d00), d10 + fu * (d11 - d10)
    return low + fv * (high - low), (1.0 - fv) * (d01 - d00) + fv * (d11 - d10), high - low


@kernel
def _score(
    points: FloatArray, x: float, y: float, theta: float, table: IndexArray, near: ByteArray, std: float
) -> float:
    """Mean of 1 / (1 + d^2 / 2 std^2) over the points, 0...1; `points`, x, y in cells, `std` in levels."""
    cos, sin = math.cos(theta), math.sin(theta)
    scale, total = 0.5 / (std * std), 0.0
    rows, cols = table.shape[0] << SIDE_BITS, table.shape[1] << SIDE_BITS
    for i in range(points.shape[0]):
        col = math.floor(x + cos * points[i, 0] - sin * points[i, 1])
        row = math.floor(y + sin * points[i, 0] + cos * points[i, 1])
        if 0 <= row < rows and 0 <= col < cols:
            level = _level(table, near, row, col)
            if level < FAR:
                total += 1.0 / (1.0 + scale * level * level)
    return float(total / points.shape[0])


@kernel
def _climb(
    points: FloatArray, pose: FloatArray, table: IndexArray, near: ByteArray, std: float, step: float
) -> None:
    """Hill climb on the score: six neighbours, the step halved three times when none is better."""
    best = _score(points, pose[0], pose[1], pose[2], table, near, std)
    trial, turn = pose.copy(), 0.05
    for _ in range(4):
        better = True
        while better:
            better = False
            for axis in range(3):
                for sign in (-1.0, 1.0):
                    trial[:] = pose
                    trial[axis] += sign * (turn if axis == 2 else step)
                    value = _score(points, trial[0], trial[1], trial[2], table, near, std)
                    if value > best + 1e-9:
                        best, better = value, True
                        pose[:] = trial
        step, turn = 0.5 * step, 0.5 * turn


@kernel
def _descend(
    points: FloatArray,
    pose: FloatArray,
    prior: FloatArray,
    information: FloatArray,
    table: IndexArray,
    near: ByteArray,
    beam_std: float,
    outlier: float,
    iterations: int,
    hessian: FloatArray,
) -> float:
    """Gauss-Newton with Cauchy weights from `pose` to the mode; return the beams' robust cost there.

    Everything in levels and cells; leaves the information matrix of the mode in `hessian`, shape (3, 3).
    """
    gradient, unit = np.zeros(3), 1.0 / (beam_std * beam_std)
    fade = 1.0 / (outlier * outlier)
    cost = 0.0
    for _ in range(iterations):
        hessian[:] = 0.0
        gradient[:] = 0.0
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        cost = 0.0
        for i in range(points.shape[0]):
            rx = cos * points[i, 0] - sin * points[i, 1]
            ry = sin * points[i, 0] + cos * points[i, 1]
            level, jx, jy = _look(table, near, pose[0] + rx, pose[1] + ry)
            relative = fade * level * level
            weight = unit / (1.0 + relative)
            cost += 0.5 * weight * level * level  # Geman-McClure's, which needs no logarithm
            if level >= FAR:
                continue
            jt = jy * rx - jx * ry
            gradient[0] += weight * level * jx
            gradient[1] += weight * level * jy
            gradient[2] += weight * level * jt
            hessian[0, 0] += weight * jx * jx
            hessian[0, 1] += weight * jx * jy
            hessian[0, 2] += weight * jx * jt
            hessian[1, 1] += weight * jy * jy
            hessian[1, 2] += weight * jy * jt
            hessian[2, 2] += weight * jt * jt
        for axis in range(3):
            for other in range(3):
                gradient[axis] += information[axis, other] * (pose[other] - prior[other])
                hessian[axis, other] += information[axis, other]
        hessian[1, 0], hessian[2, 0], hessian[2, 1] = hessian[0, 1], hessian[0, 2], hessian[1, 2]
        step = solve3(hessian, gradient)
        shrink = min(1.0, 6.0 / max(TINY, math.hypot(step[0], step[1])), 0.15 / max(TINY, abs(step[2])))
        for axis in range(3):
            pose[axis] -= shrink * step[axis]
        if abs(step[0]) + abs(step[1]) < 0.02 and abs(step[2]) < 4e-4:
            break
    return cost


@kernel
def match_all(
    points: FloatArray,
    predicted: FloatArray,
    information: FloatArray,
    tables: IndexArray,
    near: ByteArray,
    beam_std: float,
    outlier: float,
    score_std: float,
    climb_below: float,
    iterations: int,
    matched: FloatArray,
    draws: FloatArray,
    costs: FloatArray,
    scores: FloatArray,
    informations: FloatArray,
) -> None:
    """Match every particle; on entry `draws`, shape (particles, 3), are standard normal numbers.

    `predicted`, shape (particles, 3), is x, y in cells from the tables' corner and theta; `information`,
    shape (3, 3), the inverse of odometry's covariance in the same units. Leaves the modes in `matched`, the
    samples of the proposal in `draws`, the beams' costs, the scores, and the information of the modes, shape
    (particles, 3, 3). Where Gauss-Newton explains less than `climb_below`, it starts again from the top of a
    hill climb, and the better of the two stays.

    Odometry's error is nearly the same for all particles, so each match starts with the correction that the
    one before has found. The prior stays at the particle's own prediction.
    """
    hessian, other = np.zeros((3, 3)), np.zeros((3, 3))
    found = np.zeros(3)  # the correction, in the robot's frame
    for k in range(predicted.shape[0]):
        pose = predicted[k].copy()
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        pose[0] += cos * found[0] - sin * found[1]
        pose[1] += sin * found[0] + cos * found[1]
        pose[2] += found[2]
        costs[k] = _descend(
            points, pose, predicted[k], information, tables[k], near, beam_std, outlier, iterations, hessian
        )
        scores[k] = _score(points, pose[0], pose[1], pose[2], tables[k], near, score_std)
        if scores[k] < climb_below:
            again = predicted[k].copy()
            _climb(points, again, tables[k], near, score_std, 2.0)
            cost = _descend(
                points,
                again,
                predicted[k],
                information,
                tables[k],
                near,
                beam_std,
                outlier,
                iterations,
                other,
            )
            value = _score(points, again[0], again[1], again[2], tables[k], near, score_std)
            if value > scores[k]:
                scores[k], costs[k] = value, cost
                pose[:] = again
                hessian[:] = other
        matched[k], informations[k] = pose, hessian
        dx, dy = pose[0] - predicted[k, 0], pose[1] - predicted[k, 1]
        found[0], found[1], found[2] = cos * dx + sin * dy, cos * dy - sin * dx, pose[2] - predicted[k, 2]
        draws[k] = pose + spread3(hessian, draws[k])
