"""What every mapper offers: odometry and a scan in, the corrected pose and the grid out."""

from dataclasses import dataclass
from typing import Protocol

from thumper.geometry import Pose2, Twist2
from thumper.lidar.scan import Scan
from thumper.mapping.grid import OccupancyGrid


@dataclass(frozen=True, slots=True, kw_only=True)
class MapperUpdate:
    """What one scan taught the mapper."""

    map_from_base: Pose2  # corrected pose of the robot at `scan.time_s`
    match_score: float  # mean likelihood of the beams at that pose, 0...1; NaN when the scan was not matched
    integrated: bool  # whether the scan changed the map


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
        """The map so far (a copy)."""
        ...
