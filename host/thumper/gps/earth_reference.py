"""Where the map lies on Earth, and where the robot is in it by GPS."""

import math
from typing import NamedTuple

from thumper.common.geometry import Pose2
from thumper.gps.alignment import Alignment
from thumper.gps.fix import Fix, FixStatus
from thumper.gps.local_plane import EastNorth, LatLon, LocalPlane
from thumper.gps.navsat_filter import MIN_STD_M, NavsatFilter
from thumper.gps.options import GpsOptions
from thumper.gps.position_prior import PositionPrior

DATUM_STD_RAD = 0.1  # of the map's direction, or it is not saved
DRIVE_TO_FIND_IT = "a drive with a fix, of 1 to 2 m with RTK, else of 30 m and more"
PLACE_UNKNOWN = f"the place of the map on Earth is unknown: that takes {DRIVE_TO_FIND_IT}"


class MapDatum(NamedTuple):
    """The place of a map's origin on Earth, and the direction of its x axis, counter-clockwise from east."""

    latitude_deg: float
    longitude_deg: float
    yaw_rad: float

    @property
    def text(self) -> str:
        """The place for people."""
        at = LatLon(self.latitude_deg, self.longitude_deg)
        return f"the map's origin is at {at}, its x axis {math.degrees(self.yaw_rad):.0f} degrees from east"

    def to_map(self, place: LatLon) -> tuple[float, float]:
        """Return x and y of a place in the map [m]."""
        point = LocalPlane(LatLon(self.latitude_deg, self.longitude_deg)).to_plane(place)
        at = Pose2(theta_rad=-self.yaw_rad) @ Pose2(x_m=point.east_m, y_m=point.north_m)
        return at.x_m, at.y_m


class EarthReference:
    """Fuses fixes with odometry, and aligns the map with the fixes unless its datum is known."""

    def __init__(self, options: GpsOptions, datum: MapDatum | None = None) -> None:
        """`datum` is that of a loaded map."""
        self._base_from_antenna = options.base_from_antenna
        self.restart(datum)

    def restart(self, datum: MapDatum | None) -> None:
        """Start again in another map."""
        place = None if datum is None else LatLon(datum.latitude_deg, datum.longitude_deg)
        self.filter = NavsatFilter(self._base_from_antenna, place)
        self._datum = datum
        self._alignment = Alignment()  # of the map

    def add(self, fix: Fix, odom_at_fix: Pose2, map_from_odom: Pose2 | None, *, drift_m: float) -> None:
        """Add a fix, with the odometry at its time, and its drift since the last match with the map.

        `map_from_odom` is None while the pose in the map is lost. Where the drift is larger than the fix's
        error, an aligned map follows the GPS. Then it shows nothing more about the alignment.
        """
        plane = self.filter.plane
        seen = self.filter.correct(fix, odom_at_fix)
        if self.filter.plane is not plane:
            self._alignment = Alignment()
        is_needed = drift_m < fix.std_m or self.enu_from_map is None
        if seen is not None and map_from_odom is not None and is_needed:
            antenna = map_from_odom @ odom_at_fix @ self._base_from_antenna
            self._alignment.add(fix.time_s, antenna, seen, max(fix.std_m, MIN_STD_M) ** 2 + drift_m**2)

    def prior(self, fix: Fix) -> PositionPrior | None:
        """Return the position in a loaded map; None without a fix or a datum."""
        if self._datum is None or fix.status is FixStatus.NONE:
            return None
        lever_m = math.hypot(self._base_from_antenna.x_m, self._base_from_antenna.y_m)
        at = self._datum.to_map(LatLon(fix.latitude_deg, fix.longitude_deg))
        return PositionPrior(*at, math.hypot(fix.std_m, lever_m), fix.time_s)

    def in_map(self, fix: Fix) -> tuple[float, float] | None:
        """Return x and y of a fix in the map [m]; None as long as the map's place on Earth is unknown."""
        datum = self.map_datum()
        if datum is None or fix.status is FixStatus.NONE:
            return None
        return datum.to_map(LatLon(fix.latitude_deg, fix.longitude_deg))

    @property
    def enu_from_map(self) -> Pose2 | None:
        """The map in the plane of the filter; None as long as its direction is unknown."""
        if self._datum is not None:
            return Pose2(theta_rad=self._datum.yaw_rad)
        return self._alignment.enu_from_frame() if self._alignment.std_rad < DATUM_STD_RAD else None

    @property
    def heading_var_rad2(self) -> float:
        """Variance of the robot's heading in the map by GPS; infinite as long as it is unknown."""
        of_map = 0.0 if self._datum is not None else self._alignment.std_rad**2
        return math.inf if self.filter.enu_from_odom is None else float(self.filter.covariance[2, 2]) + of_map

    def map_datum(self) -> MapDatum | None:
        """Return the datum to save with the map; None as long as it is unknown."""
        plane, at = self.filter.plane, self.enu_from_map
        if plane is None or at is None:
            return self._datum
        place = plane.to_earth(EastNorth(at.x_m, at.y_m))
        return MapDatum(*place, at.theta_rad)

    def map_from_odom(self, *, better_than_m: float) -> Pose2 | None:
        """Return the transform by GPS; None if its position is not as good as that."""
        enu_from_map, enu_from_odom = self.enu_from_map, self.filter.enu_from_odom
        if enu_from_map is None or enu_from_odom is None or self.filter.std_m >= better_than_m:
            return None
        return enu_from_map.inverse() @ enu_from_odom
