"""Gauss-Newton scan matching: the pose at which the beams end on occupied cells.

Levenberg-Marquardt damping on the distance field with bilinear interpolation. Kohlbrecher et al. do the same
on an occupancy map ("A flexible and scalable SLAM system with full 3D motion estimation", SSRR 2011, sections
"Map access" and "Scan matching").
"""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.numba_kernel import kernel, member
from thumper.slam.scan_matching.degeneracy import weakest_direction
from thumper.slam.scan_matching.distance_field import (
    DistanceField,
    MetricField,
    distance_at,
    field_shape,
)
from thumper.slam.scan_matching.linalg3 import inverse3, solve3
from thumper.slam.scan_matching.patch_grid import PatchField

MIN_HITS = 10  # a scan with fewer hits cannot fix three unknowns against noise
OUTLIER_M = 0.15  # distance at which a beam's Cauchy weight has fallen to one half
MAX_ITERATIONS = 30  # a good prediction needs 4 to 8
MIN_WALL_SHARE = 0.02  # with less of the visible wall across it, a direction counts as degenerate
ZERO_COVARIANCE: FloatArray = np.zeros((3, 3))  # of a pose that is known exactly
HUGE = 1e200  # of numbers up to 1e308
DEGENERATE_STD_M = 0.001  # of odometry between two scans, along a degenerate direction


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchOptions:
    """Weights of beams and odometry in the scan match."""

    # Error of a beam's end. Neighbouring beams are correlated, so it is larger than the sensor's own error.
    beam_std_m: Annotated[float, Gt(0)] = 0.05
    odometry_std_m: Annotated[float, Gt(0)] = 0.01  # error of the predicted position without motion
    odometry_std_rad: Annotated[float, Gt(0)] = 0.005  # error of the predicted heading without motion
    slip_per_m: Annotated[float, Ge(0)] = 0.2  # growth of both errors per metre since the last scan
    slip_per_rad: Annotated[float, Ge(0)] = 0.2  # growth of the heading error per radian since the last scan


class MatchWeights(NamedTuple):
    """Parameters of the Gauss-Newton kernels."""

    beam_std_m: float
    outlier_m: float = OUTLIER_M
    iterations: int = MAX_ITERATIONS


class PosePrior(NamedTuple):
    """A Gaussian over poses: mean, shape (3,), and inverse covariance, shape (3, 3)."""

    pose: FloatArray
    information: FloatArray


class NormalEquations(NamedTuple):
    """Gauss-Newton system: H, shape (3, 3), and gradient, shape (3,)."""

    hessian: FloatArray
    gradient: FloatArray


def degenerate_direction(heading_rad: float, hits_m: FloatArray) -> FloatArray:
    """Return the unit vector in the map that no visible wall constrains, shape (2,); zeros for none."""
    x, y, share = weakest_direction(hits_m)
    if share >= MIN_WALL_SHARE:
        return np.zeros(2)
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([cos * x - sin * y, sin * x + cos * y])


def odometry_information(
    options: MatchOptions,
    moved: Pose2,
    degenerate: FloatArray,
    covariance: FloatArray = ZERO_COVARIANCE,
    *,
    turn_std_rad: float = math.inf,
) -> FloatArray:
    """Return the inverse covariance of the pose predicted by odometry, shape (3, 3).

    `covariance`, shape (3, 3), is that of the pose before it `moved`: what a corridor left undetermined, the
    first walls across it may correct. Along `degenerate`, shape (2,), odometry alone decides. The turn's
    error is at most `turn_std_rad`.
    """
    distance_m, turn_rad = math.hypot(moved.x_m, moved.y_m), abs(moved.theta_rad)
    std_m = options.odometry_std_m + options.slip_per_m * distance_m
    std_rad = options.odometry_std_rad + options.slip_per_m * distance_m + options.slip_per_rad * turn_rad
    std_rad = min(std_rad, turn_std_rad)
    return _prediction_information(covariance, std_m, std_rad, degenerate)


@kernel
def _prediction_information(
    covariance: FloatArray, std_m: float, std_rad: float, degenerate: FloatArray
) -> FloatArray:
    predicted = covariance.copy()
    predicted[0, 0] += std_m * std_m
    predicted[1, 1] += std_m * std_m
    predicted[2, 2] += std_rad * std_rad
    information = inverse3(predicted)
    for i in range(2):
        for j in range(2):
            information[i, j] += degenerate[i] * degenerate[j] / (DEGENERATE_STD_M * DEGENERATE_STD_M)
    return information


@kernel
def bilinear(
    d00: float, d01: float, d10: float, d11: float, fu: float, fv: float
) -> tuple[float, float, float]:
    """Return value and slopes per cell between four cell centres.

    `fu`, `fv` are the fractions of a cell from d00 towards d01 and towards d10.
    """
    low, high = d00 + fu * (d01 - d00), d10 + fu * (d11 - d10)
    return low + fv * (high - low), (1.0 - fv) * (d01 - d00) + fv * (d11 - d10), high - low


@kernel
def interpolate(field: MetricField, col: float, row: float) -> tuple[float, float, float]:
    """Return distance [m] and slopes along columns and rows [m/cell] at a point in cells (centres at .5)."""
    rows, cols = field_shape(field)
    u, v = col - 0.5, row - 0.5
    c, r = math.floor(u), math.floor(v)
    if c < 0 or r < 0 or c + 1 >= cols or r + 1 >= rows:
        return field.max_distance_m, 0.0, 0.0
    d00, d01 = float(distance_at(field, r, c)), float(distance_at(field, r, c + 1))
    d10, d11 = float(distance_at(field, r + 1, c)), float(distance_at(field, r + 1, c + 1))
    return bilinear(d00, d01, d10, d11, u - c, v - r)


@kernel
def score(points_m: FloatArray, pose: FloatArray, field: MetricField, std_m: float) -> float:
    """Return the mean of exp(-d^2 / 2 std^2) over the points, 0...1.

    `pose` (x, y, theta) is in metres from the array's corner.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    resolution_m, total = field.resolution_m, 0.0
    for i in range(points_m.shape[0]):
        x_m = pose[0] + cos * points_m[i, 0] - sin * points_m[i, 1]
        y_m = pose[1] + sin * points_m[i, 0] + cos * points_m[i, 1]
        d_m, _, _ = interpolate(field, x_m / resolution_m, y_m / resolution_m)
        if d_m < field.max_distance_m:
            total += math.exp(-0.5 * (d_m / std_m) ** 2)
    return float(total / points_m.shape[0])


@kernel
def _add_beam(
    system: NormalEquations, weight: float, residual: float, jx: float, jy: float, jt: float
) -> None:
    """Add one beam to Hessian and gradient; `jx`, `jy`, `jt` are the residual's derivatives."""
    hessian, gradient = system.hessian, system.gradient
    gradient[0] += weight * residual * jx
    gradient[1] += weight * residual * jy
    gradient[2] += weight * residual * jt
    hessian[0, 0] += weight * jx * jx
    hessian[0, 1] += weight * jx * jy
    hessian[0, 2] += weight * jx * jt
    hessian[1, 1] += weight * jy * jy
    hessian[1, 2] += weight * jy * jt
    hessian[2, 2] += weight * jt * jt


@kernel
def add_prior(system: NormalEquations, pose: FloatArray, prior: PosePrior, cost: float) -> float:
    """Add the prior, complete the symmetric system, and return `cost` plus the prior's half-square."""
    hessian, gradient = system.hessian, system.gradient
    for k in range(3):
        for j in range(3):
            pull = prior.information[k, j] * (pose[j] - prior.pose[j])
            cost += 0.5 * pull * (pose[k] - prior.pose[k])
            gradient[k] += pull
            hessian[k, j] += prior.information[k, j]
    hessian[1, 0], hessian[2, 0], hessian[2, 1] = hessian[0, 1], hessian[0, 2], hessian[1, 2]
    return cost


def sample(field: object, x: float, y: float) -> tuple[float, float, float]:
    """Return a beam's residual and its slopes along x and y, for an end at this point of the field.

    A generic function of kernels: each kind of field is a member. The slopes are 0 where nothing is near.
    """
    raise NotImplementedError


@member(sample, PatchField)
@member(sample, DistanceField)
def _sample_metres(field: MetricField, x: float, y: float) -> tuple[float, float, float]:
    cells_per_m = 1.0 / field.resolution_m
    d_m, du, dv = interpolate(field, x * cells_per_m, y * cells_per_m)
    if d_m >= field.max_distance_m:
        return d_m, 0.0, 0.0
    return d_m, du * cells_per_m, dv * cells_per_m


@kernel
def add_beams(
    points: FloatArray, pose: FloatArray, field: object, std: float, outlier: float, system: NormalEquations
) -> tuple[float, float]:
    """Fill the Gauss-Newton system with the beams at `pose`; return their Cauchy and Geman-McClure costs.

    `points`, shape (n, 2), and `pose`, shape (3,), are in the unit of the field. A beam at the distance d has
    the weight 1 / std^2 / (1 + d^2/c^2) with c = `outlier`, frozen in the system. Its costs are
    c^2/2 / std^2 log(1 + d^2/c^2), and d^2/2 times the weight.
    """
    system.hessian[:] = 0.0
    system.gradient[:] = 0.0
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    unit, fade = 1.0 / (std * std), 1.0 / (outlier * outlier)
    logarithms, product, squares = 0.0, 1.0, 0.0
    for i in range(points.shape[0]):
        rx = cos * points[i, 0] - sin * points[i, 1]  # the beam's end is pose + (rx, ry)
        ry = sin * points[i, 0] + cos * points[i, 1]
        residual, jx, jy = sample(field, pose[0] + rx, pose[1] + ry)
        factor = 1.0 + fade * residual * residual
        weight = unit / factor
        squares += weight * residual * residual
        product *= factor  # one logarithm for many beams
        if product > HUGE:
            logarithms, product = logarithms + math.log(product), 1.0
        if jx == 0.0 and jy == 0.0:
            continue
        _add_beam(system, weight, residual, jx, jy, jy * rx - jx * ry)  # chain rule over the heading
    return 0.5 * unit * outlier * outlier * (logarithms + math.log(product)), 0.5 * squares


@kernel
def normal_equations(
    points_m: FloatArray,
    pose: FloatArray,
    prior: PosePrior,
    field: MetricField,
    weights: MatchWeights,
    system: NormalEquations,
) -> float:
    """Fill the Gauss-Newton system at `pose`; return the cost of beams and prior there."""
    cost, _ = add_beams(points_m, pose, field, weights.beam_std_m, weights.outlier_m, system)
    return add_prior(system, pose, prior, cost)


@kernel
def beam_information(
    points_m: FloatArray, pose: FloatArray, field: MetricField, weights: MatchWeights
) -> FloatArray:
    """Return the information of the beams alone at the pose (inverse covariance), shape (3, 3)."""
    system = NormalEquations(np.zeros((3, 3)), np.zeros(3))
    no_prior = PosePrior(pose, np.zeros((3, 3)))
    normal_equations(points_m, pose, no_prior, field, weights, system)
    return system.hessian


@kernel
def match(
    points_m: FloatArray, start: FloatArray, prior: PosePrior, field: MetricField, weights: MatchWeights
) -> FloatArray:
    """Return the pose (x, y, theta), shape (3,), of least cost near `start`.

    `prior` is the pose predicted by odometry. It decides along directions that the scan leaves open, such as
    a corridor's. Poses are in metres from the array's corner; headings are not wrapped.
    """
    pose, trial = start.copy(), start.copy()
    system = NormalEquations(np.zeros((3, 3)), np.zeros(3))
    trial_system = NormalEquations(np.zeros((3, 3)), np.zeros(3))
    damped = np.zeros((3, 3))
    damping = 1e-3
    cost = normal_equations(points_m, pose, prior, field, weights, system)
    for _ in range(weights.iterations):
        damped[:] = system.hessian
        for k in range(3):
            damped[k, k] *= 1.0 + damping
        step = solve3(damped, system.gradient)  # Gauss-Newton: H^-1 g
        for k in range(3):
            trial[k] = pose[k] - step[k]
        trial_cost = normal_equations(points_m, trial, prior, field, weights, trial_system)
        if trial_cost < cost:
            pose[:] = trial
            system.hessian[:] = trial_system.hessian
            system.gradient[:] = trial_system.gradient
            cost = trial_cost
            damping = max(1e-6, 0.2 * damping)
        else:
            damping *= 10.0
        if abs(step[0]) + abs(step[1]) < 1e-4 and abs(step[2]) < 1e-4:
            break
    return pose
