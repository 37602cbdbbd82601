"""The `Mapper` protocol: odometry and a scan in, the corrected pose and the grid out."""

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.gps.position_prior import PositionPrior
from thumper.lidar.scan import Scan
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OccupancyGrid


@dataclass(frozen=True, slots=True, kw_only=True)
class MapperUpdate:
    """The result of one scan."""

    map_from_base: Pose2  # corrected pose of the robot at `scan.time_s`
    match_score: float  # mean likelihood of the beams at that pose, 0...1; NaN if the scan was not matched
    integrated: bool  # whether the scan was inserted into the map
    jumped: bool = False  # the pose changed without motion: loop closure, given pose or relocalization


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseQuality:
    """How reliable a pose is."""

    covariance: FloatArray  # of x, y, theta in the map, shape (3, 3) [m^2, m rad, rad^2]
    explained: float  # mean likelihood of the beams of the newest matched scan at the pose, 0...1
    lost: str  # why the robot must not drive by this pose; empty while it may
    has_drifted: bool = False  # lost only because no wall has fixed the position for long

    @property
    def std_m(self) -> float:
        """Standard deviation of the position along its worst direction [m]."""
        xx, xy, yy = self.covariance[0, 0], self.covariance[0, 1], self.covariance[1, 1]
        largest = 0.5 * (xx + yy) + math.hypot(0.5 * (xx - yy), xy)
        return math.sqrt(max(0.0, float(largest)))


class Mapper(Protocol):
    """Simultaneous localization and mapping, one call per scan."""

    def update(
        self, odom_from_base: Pose2, scan: Scan, twist: Twist2, *, turn_std_rad: float = math.inf
    ) -> MapperUpdate:
        """Process one scan.

        `odom_from_base` is the odometry pose at `scan.time_s` (beam 0). `twist` is the speed during the
        revolution, for de-skewing. `turn_std_rad` is the error of the odometry's turn since the newest
        scan in the map, if a gyroscope measured it; methods that assume more anyway ignore it.
        """
        ...

    @property
    def map_from_odom(self) -> Pose2:
        """The correction found by the newest match."""
        ...

    def grid(self) -> OccupancyGrid:
        """Return the current map. A returned grid never changes and is read-only."""
        ...

    def counts(self) -> HitCounts:
        """Return a copy of the map's hit and miss counts, to resume mapping later."""
        ...

    def quality(self) -> PoseQuality:
        """Return the covariance of the newest pose and whether it is lost."""
        ...


@runtime_checkable
class HasParticles(Protocol):
    """A mapper whose pose estimate is a particle cloud."""

    @property
    def particle_poses(self) -> FloatArray | None:
        """x, y, theta of each particle, shape (n, 3); None while the active method has no particles."""
        ...


@runtime_checkable
class ReportsDoubt(Protocol):
    """A mapper that checks whether its map fits the place."""

    @property
    def map_doubt(self) -> str:
        """Why the map may be the wrong one; empty while it fits."""
        ...


@runtime_checkable
class Relocalizable(Protocol):
    """A mapper that accepts a pose from the operator, or searches the whole map for it."""

    def set_pose(self, map_from_base: Pose2) -> None:
        """Restart from this approximate pose; the next scan refines it."""
        ...

    def relocalize(self) -> None:
        """Discard the pose; the next scan is searched for in the whole map."""
        ...


@runtime_checkable
class AcceptsPositionPrior(Protocol):
    """A mapper that a position from elsewhere, as from GPS, helps to choose between similar places."""

    def set_position_prior(self, prior: PositionPrior) -> None:
        """Expect the robot near this position in the map at the next search of the whole map."""
        ...


@runtime_checkable
class SwitchesMode(Protocol):
    """A mapper that can change between mapping and localization."""

    @property
    def is_localizing(self) -> bool:
        """Whether the map is fixed and only the pose is estimated."""
        ...


@runtime_checkable
class DetectsKidnapping(Protocol):
    """A mapper that notices that the robot was carried away."""

    @property
    def kidnapped(self) -> bool:
        """Whether the robot was carried away: only a search of the whole map can find it."""
        ...


@runtime_checkable
class ChecksMap(Protocol):
    """A mapper that can tell whether its finished map agrees with itself."""

    def contradiction(self) -> str:
        """Return where a place is drawn twice; empty if none is. It takes seconds for a large map."""
        ...
