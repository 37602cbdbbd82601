"""Align a frame of the robot with the plane of a datum, from positions known in both.

Weighted least squares over the pairs so far (Umeyama, "Least-squares estimation of transformation parameters
between two point patterns", PAMI 1991, in the plane and without scale), as running sums.
"""

import math
from dataclasses import dataclass

from thumper.common.geometry import Pose2
from thumper.gps.local_plane import EastNorth

CORRELATION_S = 10.0
"""Positions closer in time share most of their error, so together they weigh as one."""


@dataclass(slots=True)
class Alignment:
    """The transform `enu_from_frame`, with x east and y north, and how certain it is."""

    weight: float = 0.0  # [1/m^2]
    x_m: float = 0.0  # weighted means in the frame...
    y_m: float = 0.0
    east_m: float = 0.0  # ...and in the plane
    north_m: float = 0.0
    spread: float = 0.0  # weighted squared distances from the mean of the frame
    dot: float = 0.0
    cross: float = 0.0
    _last_s: float = -math.inf

    def add(self, time_s: float, at: Pose2, seen: EastNorth, variance_m2: float) -> None:
        """Add a position in the frame and the same in the plane."""
        weight = min(1.0, max(time_s - self._last_s, 0.0) / CORRELATION_S) / variance_m2
        self._last_s = time_s
        if weight == 0.0:
            return
        share = weight / (self.weight + weight)
        dx, dy = at.x_m - self.x_m, at.y_m - self.y_m
        de, dn = seen.east_m - self.east_m, seen.north_m - self.north_m
        kept = share * self.weight  # updates the second moments about the moving means (Welford 1962)
        self.spread += kept * (dx * dx + dy * dy)
        self.dot += kept * (dx * de + dy * dn)
        self.cross += kept * (dx * dn - dy * de)
        self.x_m, self.y_m = self.x_m + share * dx, self.y_m + share * dy
        self.east_m, self.north_m = self.east_m + share * de, self.north_m + share * dn
        self.weight += weight

    @property
    def std_rad(self) -> float:
        """Standard deviation of the rotation; infinite as long as nothing has moved."""
        return 1.0 / math.sqrt(self.spread) if self.spread > 0.0 else math.inf

    def std_m(self, at: Pose2) -> float:
        """Standard deviation of a transformed position [m]."""
        lever_m = math.hypot(at.x_m - self.x_m, at.y_m - self.y_m)
        return math.hypot(1.0 / math.sqrt(self.weight), lever_m * self.std_rad)

    def enu_from_frame(self) -> Pose2:
        """Return the transform."""
        rotation_rad = math.atan2(self.cross, self.dot)
        mean = Pose2(x_m=self.east_m, y_m=self.north_m, theta_rad=rotation_rad)
        return mean @ Pose2(x_m=-self.x_m, y_m=-self.y_m)
