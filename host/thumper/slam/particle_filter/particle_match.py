"""Scan matching in each particle's own map, which gives its improved proposal and its weight.

The matched pose is the mode of beams times odometry, and the inverse of the Gauss-Newton matrix is its
covariance. That is the Gaussian from which Grisetti, Stachniss, Burgard draw their improved proposal
("Improved techniques for grid mapping with Rao-Blackwellized particle filters", IEEE T-RO 23(1), 2007,
section III), here without their samples.
"""

import math
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel, member
from thumper.slam.scan_matching.distance_field import ByteArray
from thumper.slam.scan_matching.gauss_newton import (
    NormalEquations,
    PosePrior,
    add_beams,
    add_prior,
    bilinear,
    sample,
)
from thumper.slam.scan_matching.linalg3 import sample3, solve3
from thumper.slam.scan_matching.patches import FAR, MASK, SIDE_BITS, IndexArray

TINY = 1e-12
MAX_STEP_CELLS, MAX_STEP_RAD = 6.0, 0.15  # of one Gauss-Newton step
CLIMB_STEP_CELLS, CLIMB_STEP_RAD = 2.0, 0.05  # first steps of the hill climb


class PatchMaps(NamedTuple):
    """The quantized distance fields of all particles."""

    tables: IndexArray  # patch numbers, shape (particles, rows, columns)
    distance: ByteArray  # levels 0...254 or FAR, shape (patches, SIDE, SIDE)


class PatchMap(NamedTuple):
    """The quantized distance field of one particle."""

    table: IndexArray  # patch numbers, shape (rows, columns)
    distance: ByteArray


class ParticleMatchWeights(NamedTuple):
    """Parameters of the match; standard deviations and distances in levels of the distance field."""

    beam_std: float
    outlier: float
    score_std: float
    climb_below: float  # a score below this adds the hill climb
    iterations: int


class ParticleMatches(NamedTuple):
    """The matches of all particles; poses are x, y, theta."""

    poses: FloatArray  # modes, shape (particles, 3)
    draws: FloatArray  # samples of the proposal, shape (particles, 3)
    costs: FloatArray  # robust cost of the beams, shape (particles,)
    scores: FloatArray  # mean likelihood of the beams, 0...1, shape (particles,)
    informations: FloatArray  # of the modes, in cells and radians, shape (particles, 3, 3)


@kernel
def _level(field: PatchMap, row: int, col: int) -> float:
    return float(field.distance[field.table[row >> SIDE_BITS, col >> SIDE_BITS], row & MASK, col & MASK])


@member(sample, PatchMap)
def _sample_levels(field: PatchMap, x: float, y: float) -> tuple[float, float, float]:
    """Return the bilinear level and its slopes along x and y per cell at a point in cells."""
    u, v = x - 0.5, y - 0.5
    c, r = math.floor(u), math.floor(v)
    rows, cols = field.table.shape
    if c < 0 or r < 0 or c + 1 >= cols << SIDE_BITS or r + 1 >= rows << SIDE_BITS:
        return float(FAR), 0.0, 0.0
    rr, cc = r & MASK, c & MASK
    if rr < MASK and cc < MASK:
        patch = field.distance[field.table[r >> SIDE_BITS, c >> SIDE_BITS]]
        d00, d01 = float(patch[rr, cc]), float(patch[rr, cc + 1])
        d10, d11 = float(patch[rr + 1, cc]), float(patch[rr + 1, cc + 1])
    else:
        d00, d01 = _level(field, r, c), _level(field, r, c + 1)
        d10, d11 = _level(field, r + 1, c), _level(field, r + 1, c + 1)
    level, jx, jy = bilinear(d00, d01, d10, d11, u - c, v - r)
    return (level, jx, jy) if level < FAR else (level, 0.0, 0.0)


@kernel
def _score(points: FloatArray, pose: FloatArray, field: PatchMap, std: float) -> float:
    """Return the mean of 1 / (1 + d^2 / 2 std^2) over the points, 0...1; points and pose in cells."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    scale, total = 0.5 / (std * std), 0.0
    rows, cols = field.table.shape[0] << SIDE_BITS, field.table.shape[1] << SIDE_BITS
    for i in range(points.shape[0]):
        col = math.floor(pose[0] + cos * points[i, 0] - sin * points[i, 1])
        row = math.floor(pose[1] + sin * points[i, 0] + cos * points[i, 1])
        if 0 <= row < rows and 0 <= col < cols:
            level = _level(field, row, col)
            if level < FAR:
                total += 1.0 / (1.0 + scale * level * level)
    return float(total / points.shape[0])


@kernel
def _hill_climb(points: FloatArray, pose: FloatArray, field: PatchMap, std: float) -> None:
    """Climb to a maximum of the score: six neighbours, steps halved three times when none is better."""
    best = _score(points, pose, field, std)
    trial, step, turn = pose.copy(), CLIMB_STEP_CELLS, CLIMB_STEP_RAD
    for _ in range(4):
        better = True
        while better:
            better = False
            for axis in range(3):
                for sign in (-1.0, 1.0):
                    trial[:] = pose
                    trial[axis] += sign * (turn if axis == 2 else step)
                    value = _score(points, trial, field, std)
                    if value > best + 1e-9:
                        best, better = value, True
                        pose[:] = trial
        step, turn = 0.5 * step, 0.5 * turn


@kernel
def _gauss_newton(
    points: FloatArray,
    pose: FloatArray,
    prior: PosePrior,
    field: PatchMap,
    weights: ParticleMatchWeights,
    hessian: FloatArray,
) -> float:
    """Move `pose` to the mode with Cauchy weights; return the beams' robust cost there.

    All lengths are in levels and cells. Leaves the information matrix of the mode in `hessian`, shape (3, 3).
    """
    system = NormalEquations(hessian, np.zeros(3))
    cost = 0.0
    for _ in range(weights.iterations):
        _, cost = add_beams(points, pose, field, weights.beam_std, weights.outlier, system)
        add_prior(system, pose, prior, 0.0)
        step = solve3(system.hessian, system.gradient)
        shrink = min(
            1.0,
            MAX_STEP_CELLS / max(TINY, math.hypot(step[0], step[1])),
            MAX_STEP_RAD / max(TINY, abs(step[2])),
        )
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
    maps: PatchMaps,
    weights: ParticleMatchWeights,
    matches: ParticleMatches,
) -> None:
    """Match every particle and fill `matches`, whose `draws` are standard normal numbers on entry.

    `predicted`, shape (particles, 3), is x, y in cells from the tables' corner and theta. `information`,
    shape (3, 3), is the inverse of odometry's covariance in the same units. Where Gauss-Newton explains less
    than `climb_below`, it starts again from the top of a hill climb, and the better of the two stays.

    Odometry's error is nearly the same for all particles, so each match starts with the correction found by
    the one before. The prior stays at the particle's own prediction.
    """
    hessian, other_hessian = np.zeros((3, 3)), np.zeros((3, 3))
    correction = np.zeros(3)  # in the robot's frame
    for k in range(predicted.shape[0]):
        field, prior = PatchMap(maps.tables[k], maps.distance), PosePrior(predicted[k], information)
        pose = predicted[k].copy()
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        pose[0] += cos * correction[0] - sin * correction[1]
        pose[1] += sin * correction[0] + cos * correction[1]
        pose[2] += correction[2]
        cost = _gauss_newton(points, pose, prior, field, weights, hessian)
        score = _score(points, pose, field, weights.score_std)
        if score < weights.climb_below:
            other = predicted[k].copy()
            _hill_climb(points, other, field, weights.score_std)
            other_cost = _gauss_newton(points, other, prior, field, weights, other_hessian)
            other_score = _score(points, other, field, weights.score_std)
            if other_score > score:
                score, cost = other_score, other_cost
                pose[:] = other
                hessian[:] = other_hessian
        matches.poses[k], matches.informations[k] = pose, hessian
        matches.costs[k], matches.scores[k] = cost, score
        dx, dy = pose[0] - predicted[k, 0], pose[1] - predicted[k, 1]
        correction[0], correction[1] = cos * dx + sin * dy, cos * dy - sin * dx
        correction[2] = pose[2] - predicted[k, 2]
        matches.draws[k] = pose + sample3(hessian, matches.draws[k])
