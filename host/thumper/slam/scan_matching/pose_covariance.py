"""How far a matched pose can be trusted: its covariance, and the moment at which it says that it is lost."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Interval

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.numba_kernel import kernel
from thumper.slam.mapper import PoseQuality
from thumper.slam.scan_matching.linalg3 import inverse3

SURE_M, SURE_RAD = 0.005, 0.002  # no match is better than this


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseCovarianceOptions:
    """When a matched pose counts as lost."""

    lost_below: Annotated[float, Interval(ge=0, le=1)] = 0.3  # share of the beams explained ...
    lost_after: Annotated[int, Gt(0)] = 10  # ... and as many scans in a row that explain less
    lost_beyond_m: Annotated[float, Gt(0)] = 1.0  # standard deviation of the position
    error_per_m: Annotated[float, Ge(0)] = 0.05  # what wheels alone lose a metre, always to the same side
    error_rad_per_m: Annotated[float, Ge(0)] = 0.02
    error_per_rad: Annotated[float, Ge(0)] = 0.05


class PoseCovariance:
    """The covariance of one hypothesis: grows with the way, shrinks along what the scan fixes.

    Along a bare corridor the scan fixes nothing, and the pose is as good as the wheels are.
    """

    def __init__(self, options: PoseCovarianceOptions) -> None:
        self._options = options
        self.covariance: FloatArray = np.diag([SURE_M**2, SURE_M**2, SURE_RAD**2])
        self._explained, self._poor = 1.0, 0

    def moved(self, before: Pose2, after: Pose2) -> None:
        """The robot went on by odometry; poses in the map."""
        options = self._options
        x_m, y_m = after.x_m - before.x_m, after.y_m - before.y_m
        turn_rad = math.remainder(after.theta_rad - before.theta_rad, math.tau)
        way_m = math.hypot(x_m, y_m)
        std_rad = options.error_rad_per_m * way_m + options.error_per_rad * abs(turn_rad)
        _grow(self.covariance, x_m, y_m, options.error_per_m * way_m, std_rad)

    def matched(
        self, information: FloatArray, along: FloatArray, explained: float, *, new_ground: bool = False
    ) -> None:
        """A scan was matched; `information` is that of its beams, shape (3, 3), which say nothing `along`.

        On new ground a scan explains little because the map has not been there.
        """
        _see(self.covariance, information, along)
        self._explained = explained
        poor = explained < self._options.lost_below and not new_ground
        self._poor = self._poor + 1 if poor else 0

    def reset(self, covariance: FloatArray) -> None:
        """Somebody else found the pose."""
        self.covariance, self._poor = covariance.copy(), 0

    def quality(self) -> PoseQuality:
        """What all this says about the newest pose."""
        quality = PoseQuality(covariance=self.covariance.copy(), explained=self._explained, lost="")
        lost = ""
        if self._poor >= self._options.lost_after:
            lost = f"only {100.0 * self._explained:.0f} % of the scan fit the map"
        elif quality.std_m > self._options.lost_beyond_m:
            lost = f"nothing in sight fixes the place along the way: it may be {quality.std_m:.1f} m off"
        return PoseQuality(covariance=quality.covariance, explained=self._explained, lost=lost)


@kernel
def _grow(covariance: FloatArray, x_m: float, y_m: float, std_m: float, std_rad: float) -> None:
    """Move by (x, y) and add errors that have the same sign at each step: deviations add, not variances."""
    c = covariance
    # The heading's error turns the step: F = I with -y and x in the last column.
    c[0, 0] += y_m * y_m * c[2, 2] - 2.0 * y_m * c[0, 2]
    c[1, 1] += x_m * x_m * c[2, 2] + 2.0 * x_m * c[1, 2]
    c[0, 1] += x_m * c[0, 2] - y_m * c[1, 2] - x_m * y_m * c[2, 2]
    c[0, 2] -= y_m * c[2, 2]
    c[1, 2] += x_m * c[2, 2]
    way = math.hypot(x_m, y_m)
    if way > 0.0:
        ux, uy = x_m / way, y_m / way
        along = max(0.0, ux * ux * c[0, 0] + 2.0 * ux * uy * c[0, 1] + uy * uy * c[1, 1])
        more = std_m * std_m + 2.0 * std_m * math.sqrt(along)
        c[0, 0] += more * ux * ux
        c[0, 1] += more * ux * uy
        c[1, 1] += more * uy * uy
    c[2, 2] += std_rad * std_rad + 2.0 * std_rad * math.sqrt(max(0.0, c[2, 2]))
    c[1, 0], c[2, 0], c[2, 1] = c[0, 1], c[0, 2], c[1, 2]


@kernel
def _see(covariance: FloatArray, information: FloatArray, along: FloatArray) -> None:
    """Fuse a match, less what its information holds along a direction that the beams leave open."""
    keep = np.eye(3)
    for i in range(2):
        for j in range(2):
            keep[i, j] -= along[i] * along[j]
    seen = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    seen[i, j] += keep[i, k] * information[k, m] * keep[m, j]
    fused = inverse3(inverse3(covariance) + seen)
    # The direction is known to a degree or so: what leaks in through that must not make the pose sure.
    leaked = 0.0
    for i in range(2):
        for j in range(2):
            leaked += along[i] * (covariance[i, j] - fused[i, j]) * along[j]
    for i in range(2):
        for j in range(2):
            fused[i, j] += max(0.0, leaked) * along[i] * along[j]
    for i in range(3):
        for j in range(3):
            covariance[i, j] = 0.5 * (fused[i, j] + fused[j, i])
        covariance[i, i] = max(covariance[i, i], SURE_RAD**2 if i == 2 else SURE_M**2)
