"""A wrong position, with a valid checksum, far away from all others."""

import math

import pytest

from thumper.common.geometry import Pose2
from thumper.gps.earth_reference import EarthReference, MapDatum
from thumper.gps.fix import Fix, FixStatus
from thumper.gps.local_plane import EastNorth, LatLon, LocalPlane
from thumper.gps.options import GpsOptions

START = LatLon(47.28, 8.56)
FAR = LatLon(10.0, -60.0)


def fix(time_s: float, place: LatLon) -> Fix:
    return Fix(
        time_s=time_s,
        status=FixStatus.RTK,
        latitude_deg=place.latitude_deg,
        longitude_deg=place.longitude_deg,
        variances_m2=(1e-4, 1e-4, 1e-3),
    )


def drive(earth: EarthReference, far_at: int) -> None:
    """Drive 40 m to the north, at 1 m/s; one fix is far away."""
    plane = LocalPlane(START)
    for k in range(40):
        odom_from_base = Pose2(x_m=float(k))
        earth.filter.predict(odom_from_base, 1e-4 * k)
        place = FAR if k == far_at else plane.to_earth(EastNorth(0.0, float(k)))
        earth.add(fix(float(k), place), odom_from_base, Pose2(), drift_m=0.0)


@pytest.mark.parametrize("far_at", [0, 1, 30])
def test_a_far_position_is_rejected(far_at: int) -> None:
    earth = EarthReference(GpsOptions())
    drive(earth, far_at)
    assert earth.filter.rejected in (1, 2)
    datum = earth.map_datum()
    assert datum is not None
    assert math.hypot(*LocalPlane(START).to_plane(LatLon(*datum[:2]))) < 2.0
    assert datum.yaw_rad == pytest.approx(math.pi / 2.0, abs=0.05)


def test_in_a_map_elsewhere_every_position_is_rejected() -> None:
    earth = EarthReference(GpsOptions(), MapDatum(*FAR, 0.0))
    drive(earth, -1)
    assert (earth.filter.fixes, earth.filter.rejected) == (40, 40)
    assert earth.filter.enu_from_base is None
