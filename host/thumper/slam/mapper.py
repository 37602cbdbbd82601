"""What every mapper offers: odometry and a scan in, the corrected pose and the grid out."""

import math
from dataclasses import dataclass
from typing import Protocol

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.scan import Scan
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OccupancyGrid


@dataclass(frozen=True, slots=True, kw_only=True)
class MapperUpdate:
    """What one scan taught the mapper."""

    map_from_base: Pose2  # corrected pose of the robot at `scan.time_s`
    match_score: float  # mean likelihood of the beams at that pose, 0...1; NaN when the scan was not matched
    integrated: bool  # whether the scan changed the map
    jumped: bool = False  # a loop closed, or the place was given or searched for: the robot did not move so


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseQuality:
    """How sure a pose is."""

    covariance: FloatArray  # of x, y, theta in the map, shape (3, 3) [m^2, m rad, rad^2]
    explained: float  # mean likelihood of the newest matched scan's beams at the pose, 0...1
    lost: str  # why nobody should drive by this pose; empty while one may

    @property
    def std_m(self) -> float:
        """Standard deviation of the position along its worst direction [m]."""
        xx, xy, yy = self.covariance[0, 0], self.covariance[0, 1], self.covariance[1, 1]
        largest = 0.5 * (xx + yy) + math.hypot(0.5 * (xx - yy), xy)
        return math.sqrt(max(0.0, float(largest)))


class Mapper(Protocol):
    """Simultaneous localisation and mapping behind one call a scan."""

    def update(self, odom_from_base: Pose2, scan: Scan, twist: Twist2) -> MapperUpdate:
        """Take the odometry pose at `scan.time_s` (beam 0) and the speed during the turn, for de-skewing."""
        ...

    @property
    def map_from_odom(self) -> Pose2:
        """The correction that the last match found."""
        ...

    def grid(self) -> OccupancyGrid:
        """The map so far; a grid once given does not change, and nobody may write to it."""
        ...

    def counts(self) -> HitCounts:
        """What the map so far is made of (a copy), to go on with another day."""
        ...

    def quality(self) -> PoseQuality:
        """How sure the newest pose is."""
        ...
