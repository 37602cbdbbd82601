"""The plane that touches the Earth at a datum: latitude and longitude to metres east and north, and back.

Exact for the WGS 84 ellipsoid at height 0 (Hofmann-Wellenhof et al., GNSS, 8.2.2: geodetic to Cartesian to
local-level). Height stretches distances by 1.6e-4 per kilometre.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from thumper.common.errors import EXIT_USAGE, ThumperError

SEMI_MAJOR_M = 6_378_137.0
MEAN_RADIUS_M = 6_371_009.0
ECCENTRICITY_2 = 6.694_379_990_14e-3
CONVERGED_DEG = 1e-11  # a micrometre
MAX_STEPS = 20
MAX_DISTANCE_M = 100e3  # from the datum
EXCHANGED = "; did you exchange latitude and longitude?"


class LatLon(NamedTuple):
    """A place on the WGS 84 ellipsoid [degrees]."""

    latitude_deg: float
    longitude_deg: float

    @property
    def is_valid(self) -> bool:
        """Whether it is a place on Earth."""
        return abs(self.latitude_deg) <= 90.0 and abs(self.longitude_deg) <= 180.0

    @property
    def exchanged(self) -> "LatLon":
        """The place with latitude and longitude exchanged, which may not be on Earth."""
        return LatLon(self.longitude_deg, self.latitude_deg)

    def check(self) -> None:
        """Raise ThumperError if it is not a place on Earth."""
        if not self.is_valid:
            hint = EXCHANGED if self.exchanged.is_valid else ""
            raise ThumperError(
                f"{self.latitude_deg:g} {self.longitude_deg:g} is not a place on Earth: latitude is -90...90 "
                f"degrees, longitude -180...180{hint}",
                exit_code=EXIT_USAGE,
            )

    def distance_m(self, other: "LatLon") -> float:
        """Return the distance along the surface [m], as on a sphere (haversine): within 0.6 %."""
        (latitude, longitude), (to_latitude, to_longitude) = (
            map(math.radians, place) for place in (self, other)
        )
        across = math.cos(latitude) * math.cos(to_latitude) * math.sin(0.5 * (to_longitude - longitude)) ** 2
        half_chord = math.sqrt(math.sin(0.5 * (to_latitude - latitude)) ** 2 + across)
        return 2.0 * MEAN_RADIUS_M * math.asin(min(1.0, half_chord))

    def __str__(self) -> str:
        return f"{self.latitude_deg:.6f} {self.longitude_deg:.6f}"


class EastNorth(NamedTuple):
    """A point of the plane, from its datum [m]."""

    east_m: float
    north_m: float


@dataclass(frozen=True, slots=True)
class LocalPlane:
    """The tangent plane at `datum`."""

    datum: LatLon

    def to_plane(self, place: LatLon) -> EastNorth:
        """Return the place's distance east and north of the datum."""
        x0, y0, z0 = _cartesian_m(self.datum)
        x, y, z = _cartesian_m(place)
        dx, dy, dz = x - x0, y - y0, z - z0
        latitude, longitude = (math.radians(angle) for angle in self.datum)
        outward_m = math.cos(longitude) * dx + math.sin(longitude) * dy
        return EastNorth(
            east_m=-math.sin(longitude) * dx + math.cos(longitude) * dy,
            north_m=-math.sin(latitude) * outward_m + math.cos(latitude) * dz,
        )

    def to_earth(self, point: EastNorth) -> LatLon:
        """Return the place below a point; raises ValueError beyond 100 km."""
        if not math.hypot(*point) <= MAX_DISTANCE_M:
            raise ValueError(f"{math.hypot(*point) / 1000.0:.0f} km from the datum")
        latitude = math.radians(self.datum.latitude_deg)
        curvature = 1.0 - ECCENTRICITY_2 * math.sin(latitude) ** 2
        north_radius_m = SEMI_MAJOR_M * (1.0 - ECCENTRICITY_2) / curvature**1.5
        east_radius_m = SEMI_MAJOR_M / math.sqrt(curvature) * math.cos(latitude)
        place = self.datum
        for _ in range(MAX_STEPS):  # Newton's method with the slope at the datum
            at = self.to_plane(place)
            north_deg = math.degrees((point.north_m - at.north_m) / north_radius_m)
            east_deg = math.degrees((point.east_m - at.east_m) / east_radius_m)
            place = LatLon(place.latitude_deg + north_deg, place.longitude_deg + east_deg)
            if max(abs(north_deg), abs(east_deg)) < CONVERGED_DEG:
                break
        return place


def _cartesian_m(place: LatLon) -> tuple[float, float, float]:
    """Return the Earth-centred coordinates of a place [m]."""
    latitude, longitude = (math.radians(angle) for angle in place)
    normal_m = SEMI_MAJOR_M / math.sqrt(1.0 - ECCENTRICITY_2 * math.sin(latitude) ** 2)
    return (
        normal_m * math.cos(latitude) * math.cos(longitude),
        normal_m * math.cos(latitude) * math.sin(longitude),
        normal_m * (1.0 - ECCENTRICITY_2) * math.sin(latitude),
    )
