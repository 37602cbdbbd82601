"""Covariance of a scan-matched pose, and the decision that the pose is lost."""

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.numba_kernel import kernel
from thumper.slam.mapper import PoseQuality
from thumper.slam.scan_matching.linalg3 import inverse3

MIN_STD_M, MIN_STD_RAD = 0.005, 0.002  # no match is better than this

# Systematic errors of badly calibrated wheels. They have the same sign at each step.
ERROR_PER_M = 0.05  # position, along the motion [m/m]
ERROR_RAD_PER_M = 0.02  # heading [rad/m]
ERROR_PER_RAD = 0.05  # heading [rad/rad]


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseCovarianceOptions:
    """When a matched pose counts as lost."""

    lost_below: Annotated[float, Interval(ge=0, le=1)] = 0.3  # share of the beams that the map explains
    lost_after: Annotated[int, Gt(0)] = 10  # consecutive scans below that share
    lost_beyond_m: Annotated[float, Gt(0)] = 1.0  # standard deviation of the position


class PoseCovariance:
    """The covariance of one pose hypothesis.

    It grows with the distance driven and shrinks along the directions that a scan constrains. Along a bare
    corridor the scan constrains nothing, and the pose is as good as the wheels are.
    """

    def __init__(self, options: PoseCovarianceOptions) -> None:
        self._options = options
        self.covariance: FloatArray = np.diag([MIN_STD_M**2, MIN_STD_M**2, MIN_STD_RAD**2])
        self._explained, self._poor_scans = 1.0, 0

    def predict(self, before: Pose2, after: Pose2) -> None:
        """Add the error of odometry between two poses in the map."""
        x_m, y_m = after.x_m - before.x_m, after.y_m - before.y_m
        turn_rad = math.remainder(after.theta_rad - before.theta_rad, math.tau)
        distance_m = math.hypot(x_m, y_m)
        std_rad = ERROR_RAD_PER_M * distance_m + ERROR_PER_RAD * abs(turn_rad)
        _add_motion(self.covariance, x_m, y_m, ERROR_PER_M * distance_m, std_rad)

    def update(
        self, information: FloatArray, degenerate: FloatArray, explained: float, *, new_area: bool = False
    ) -> None:
        """Fuse a match: the information of its beams, shape (3, 3), but none along `degenerate`, shape (2,).

        In a new area a scan may explain little without counting as poor.
        """
        _fuse_match(self.covariance, information, degenerate)
        self._explained = explained
        poor = explained < self._options.lost_below and not new_area
        self._poor_scans = self._poor_scans + 1 if poor else 0

    def reset(self, covariance: FloatArray) -> None:
        """Restart from a pose that another estimator found."""
        self.covariance, self._poor_scans = covariance.copy(), 0

    def quality(self) -> PoseQuality:
        """Return the quality of the newest pose."""
        quality = PoseQuality(covariance=self.covariance.copy(), explained=self._explained, lost="")
        lost, has_drifted = "", False
        if self._poor_scans >= self._options.lost_after:
            lost = f"the map explains only {100.0 * self._explained:.0f} % of the scan"
        elif quality.std_m > self._options.lost_beyond_m:
            has_drifted = True
            lost = (
                f"no visible wall fixes the position along the path: it may be {quality.std_m:.1f} m off; "
                "drive manually until the robot sees one"
            )
        return replace(quality, lost=lost, has_drifted=has_drifted)


@kernel
def _add_motion(covariance: FloatArray, x_m: float, y_m: float, std_m: float, std_rad: float) -> None:
    """Move by (x, y) and add errors of the same sign at each step: standard deviations add, not variances."""
    c = covariance
    # The heading's error turns the step: F = I with -y and x in the last column.
    c[0, 0] += y_m * y_m * c[2, 2] - 2.0 * y_m * c[0, 2]
    c[1, 1] += x_m * x_m * c[2, 2] + 2.0 * x_m * c[1, 2]
    c[0, 1] += x_m * c[0, 2] - y_m * c[1, 2] - x_m * y_m * c[2, 2]
    c[0, 2] -= y_m * c[2, 2]
    c[1, 2] += x_m * c[2, 2]
    distance = math.hypot(x_m, y_m)
    if distance > 0.0:
        ux, uy = x_m / distance, y_m / distance
        along = max(0.0, ux * ux * c[0, 0] + 2.0 * ux * uy * c[0, 1] + uy * uy * c[1, 1])
        more = std_m * std_m + 2.0 * std_m * math.sqrt(along)
        c[0, 0] += more * ux * ux
        c[0, 1] += more * ux * uy
        c[1, 1] += more * uy * uy
    c[2, 2] += std_rad * std_rad + 2.0 * std_rad * math.sqrt(max(0.0, c[2, 2]))
    c[1, 0], c[2, 0], c[2, 1] = c[0, 1], c[0, 2], c[1, 2]


@kernel
def _without_direction(information: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the information, shape (3, 3), with nothing along a direction, shape (2,) (Zhang 2016)."""
    keep = np.eye(3)
    for i in range(2):
        for j in range(2):
            keep[i, j] -= direction[i] * direction[j]
    projected = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    projected[i, j] += keep[i, k] * information[k, m] * keep[m, j]
    return projected


@kernel
def _fuse_match(covariance: FloatArray, information: FloatArray, degenerate: FloatArray) -> None:
    """Fuse a match, without the part of its information along the degenerate direction."""
    fused = inverse3(inverse3(covariance) + _without_direction(information, degenerate))
    # The direction is known only to about a degree. What leaks in through that must not shrink the pose's
    # uncertainty along it.
    leaked = 0.0
    for i in range(2):
        for j in range(2):
            leaked += degenerate[i] * (covariance[i, j] - fused[i, j]) * degenerate[j]
    for i in range(2):
        for j in range(2):
            fused[i, j] += max(0.0, leaked) * degenerate[i] * degenerate[j]
    for i in range(3):
        for j in range(3):
            covariance[i, j] = 0.5 * (fused[i, j] + fused[j, i])
        covariance[i, i] = max(covariance[i, i], MIN_STD_RAD**2 if i == 2 else MIN_STD_M**2)
