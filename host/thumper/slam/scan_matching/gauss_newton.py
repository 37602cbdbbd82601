"""Scan matching: the pose at which the ends of the beams lie on occupied cells.

Gauss-Newton (Levenberg-Marquardt damping) on the distance field with bilinear interpolation, as Kohlbrecher
et al. do on an occupancy map ("A flexible and scalable SLAM system with full 3D motion estimation", SSRR
2011).
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Interval

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.numba_kernel import kernel
from thumper.slam.scan_matching.degeneracy import open_direction
from thumper.slam.scan_matching.distance_field import FieldArray
from thumper.slam.scan_matching.linalg3 import inverse3, solve3

SURE: FloatArray = np.zeros((3, 3))  # the covariance of a pose that is known
OPEN_STD_M = 0.001  # of odometry, between two scans, along a direction that the walls leave open


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchOptions:
    """How beams and odometry are weighed against each other."""

    beam_std_m: Annotated[float, Gt(0)] = (
        0.05  # error of a beam's end; correlated beams count as a larger one
    )
    outlier_m: Annotated[float, Gt(0)] = (
        0.15  # distance at which a beam's weight has fallen to a half (Cauchy)
    )
    odometry_std_m: Annotated[float, Gt(0)] = 0.01  # trust in the predicted position while standing
    odometry_std_rad: Annotated[float, Gt(0)] = 0.005  # trust in the predicted heading while standing
    slip_per_m: Annotated[float, Ge(0)] = 0.2  # both grow by this for each metre and ...
    slip_per_rad: Annotated[float, Ge(0)] = 0.2  # ... the heading's by this for each radian driven since
    open_below: Annotated[float, Interval(ge=0, le=0.5)] = 0.02  # share of the walls that fixes too little
    iterations: Annotated[int, Gt(0)] = 30  # at most; a good prediction needs 4 to 8


def open_along(options: MatchOptions, heading_rad: float, hits_m: FloatArray) -> FloatArray:
    """Unit vector in the map along which no wall in sight fixes the pose, shape (2,); zeros for none."""
    x, y, share = open_direction(hits_m)
    if share >= options.open_below:
        return np.zeros(2)
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([cos * x - sin * y, sin * x + cos * y])


def odometry_information(
    options: MatchOptions, moved: Pose2, along: FloatArray, covariance: FloatArray = SURE
) -> FloatArray:
    """Trust in odometry after it `moved`, shape (3, 3); `along`, shape (2,), it alone decides.

    `covariance`, shape (3, 3), is that of the pose that it moved from: what a corridor has left open on the
    way, the first walls across it may set right.
    """
    way_m, turn_rad = math.hypot(moved.x_m, moved.y_m), abs(moved.theta_rad)
    std_m = options.odometry_std_m + options.slip_per_m * way_m
    std_rad = options.odometry_std_rad + options.slip_per_m * way_m + options.slip_per_rad * turn_rad
    return _prediction(covariance, std_m, std_rad, along)


@kernel
def _prediction(covariance: FloatArray, std_m: float, std_rad: float, along: FloatArray) -> FloatArray:
    predicted = covariance.copy()
    predicted[0, 0] += std_m * std_m
    predicted[1, 1] += std_m * std_m
    predicted[2, 2] += std_rad * std_rad
    information = inverse3(predicted)
    for i in range(2):
        for j in range(2):
            information[i, j] += along[i] * along[j] / (OPEN_STD_M * OPEN_STD_M)
    return information


@kernel
def interpolate(
    distance_m: FieldArray, col: float, row: float, outside_m: float
) -> tuple[float, float, float]:
    """Bilinear value [m], slopes along columns and rows [m/cell] at a point in cells (centres at .5)."""
    u, v = col - 0.5, row - 0.5
    c, r = math.floor(u), math.floor(v)
    if c < 0 or r < 0 or c + 1 >= distance_m.shape[1] or r + 1 >= distance_m.shape[0]:
        return outside_m, 0.0, 0.0
    fu, fv = u - c, v - r
    d00, d01 = float(distance_m[r, c]), float(distance_m[r, c + 1])
    d10, d11 = float(distance_m[r + 1, c]), float(distance_m[r + 1, c + 1])
    low, high = d00 + fu * (d01 - d00), d10 + fu * (d11 - d10)
    return low + fv * (high - low), (1.0 - fv) * (d01 - d00) + fv * (d11 - d10), high - low


@kernel
def score(
    points_m: FloatArray,
    pose: FloatArray,
    distance_m: FieldArray,
    resolution_m: float,
    reach_m: float,
    std_m: float,
) -> float:
    """Mean of exp(-d^2 / 2 std^2) over the points, 0...1.

    `pose` (x, y, theta) is in metres from the array's corner.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    total = 0.0
    for i in range(points_m.shape[0]):
        x_m = pose[0] + cos * points_m[i, 0] - sin * points_m[i, 1]
        y_m = pose[1] + sin * points_m[i, 0] + cos * points_m[i, 1]
        d_m, _, _ = interpolate(distance_m, x_m / resolution_m, y_m / resolution_m, reach_m)
        if d_m < reach_m:
            total += math.exp(-0.5 * (d_m / std_m) ** 2)
    return float(total / points_m.shape[0])


@kernel
def normal_equations(
    points_m: FloatArray,
    pose: FloatArray,
    prior: FloatArray,
    information: FloatArray,
    distance_m: FieldArray,
    resolution_m: float,
    reach_m: float,
    beam_std_m: float,
    outlier_m: float,
    hessian: FloatArray,
    gradient: FloatArray,
) -> float:
    """Fill the Gauss-Newton system at `pose`, weights frozen, and return the robust cost there.

    Cost: sum of c^2/2 log(1 + d^2/c^2) / std^2 over the beams (Cauchy), plus the prior's half-square.
    """
    hessian[:] = 0.0
    gradient[:] = 0.0
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    weight_unit = 1.0 / (beam_std_m * beam_std_m)
    cost = 0.0
    for i in range(points_m.shape[0]):
        rx = cos * points_m[i, 0] - sin * points_m[i, 1]
        ry = sin * points_m[i, 0] + cos * points_m[i, 1]
        d_m, du, dv = interpolate(
            distance_m, (pose[0] + rx) / resolution_m, (pose[1] + ry) / resolution_m, reach_m
        )
        relative = (d_m / outlier_m) ** 2
        cost += 0.5 * weight_unit * outlier_m * outlier_m * math.log(1.0 + relative)
        if d_m >= reach_m:
            continue  # no slope to follow out there
        weight = weight_unit / (1.0 + relative)
        jx, jy = du / resolution_m, dv / resolution_m
        jt = -jx * ry + jy * rx
        gradient[0] += weight * d_m * jx
        gradient[1] += weight * d_m * jy
        gradient[2] += weight * d_m * jt
        hessian[0, 0] += weight * jx * jx
        hessian[0, 1] += weight * jx * jy
        hessian[0, 2] += weight * jx * jt
        hessian[1, 1] += weight * jy * jy
        hessian[1, 2] += weight * jy * jt
        hessian[2, 2] += weight * jt * jt
    for k in range(3):
        for j in range(3):
            pull = information[k, j] * (pose[j] - prior[j])
            cost += 0.5 * pull * (pose[k] - prior[k])
            gradient[k] += pull
            hessian[k, j] += information[k, j]
    hessian[1, 0], hessian[2, 0], hessian[2, 1] = hessian[0, 1], hessian[0, 2], hessian[1, 2]
    return cost


@kernel
def beam_information(
    points_m: FloatArray,
    pose: FloatArray,
    distance_m: FieldArray,
    resolution_m: float,
    reach_m: float,
    beam_std_m: float,
    outlier_m: float,
) -> FloatArray:
    """What the beams alone fix at the pose: the inverse of its covariance, shape (3, 3)."""
    hessian = np.zeros((3, 3))
    normal_equations(
        points_m, pose, pose, np.zeros((3, 3)), distance_m, resolution_m, reach_m, beam_std_m, outlier_m,
        hessian, np.zeros(3),
    )  # fmt: skip
    return hessian


@kernel
def match(
    points_m: FloatArray,
    start: FloatArray,
    prior: FloatArray,
    information: FloatArray,
    distance_m: FieldArray,
    resolution_m: float,
    reach_m: float,
    beam_std_m: float,
    outlier_m: float,
    iterations: int,
) -> FloatArray:
    """Return the pose (x, y, theta), shape (3,), of least cost near `start`.

    `prior` is the pose that odometry predicts and `information`, shape (3, 3), the inverse of its covariance:
    it decides along directions that the scan leaves open, such as a corridor's. Poses are in metres from
    the array's corner; headings are not wrapped.
    """
    pose, trial = start.copy(), start.copy()
    hessian, gradient = np.zeros((3, 3)), np.zeros(3)
    trial_hessian, trial_gradient = np.zeros((3, 3)), np.zeros(3)
    damped = np.zeros((3, 3))
    damping = 1e-3
    cost = normal_equations(
        points_m, pose, prior, information, distance_m, resolution_m, reach_m, beam_std_m, outlier_m,
        hessian, gradient,
    )  # fmt: skip
    for _ in range(iterations):
        damped[:] = hessian
        for k in range(3):
            damped[k, k] *= 1.0 + damping
        step = solve3(damped, gradient)
        for k in range(3):
            trial[k] = pose[k] - step[k]
        trial_cost = normal_equations(
            points_m, trial, prior, information, distance_m, resolution_m, reach_m, beam_std_m, outlier_m,
            trial_hessian, trial_gradient,
        )  # fmt: skip
        if trial_cost < cost:
            pose[:] = trial
            hessian[:] = trial_hessian
            gradient[:] = trial_gradient
            cost = trial_cost
            damping = max(1e-6, 0.2 * damping)
        else:
            damping *= 10.0
        if abs(step[0]) + abs(step[1]) < 1e-4 and abs(step[2]) < 1e-4:
            break
    return pose
