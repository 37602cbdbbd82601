"""Far positions with a valid checksum, and the alignment of a map on open ground."""

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


def align(ways_m: tuple[float, float], *, drift_per_m: float) -> list[MapDatum | None]:
    """Drive east twice with RTK, the map turned by 0.5 rad on the second way; return the datum after each."""
    earth, plane, datums = EarthReference(GpsOptions()), LocalPlane(START), list[MapDatum | None]()
    at_m = 0.0
    for way_m, turned_rad in zip(ways_m, (0.0, 0.5), strict=True):
        for _ in range(round(way_m / 0.1)):
            at_m += 0.1
            odom_from_base = Pose2(x_m=at_m)
            earth.filter.predict(odom_from_base, 1e-6 * at_m)
            earth.add(
                fix(2.0 * at_m, plane.to_earth(EastNorth(at_m, 0.0))),
                odom_from_base,
                Pose2(theta_rad=turned_rad),
                drift_m=drift_per_m * at_m,
            )
        datums.append(earth.map_datum())
    return datums


def test_a_map_without_matched_scans_is_aligned_once() -> None:
    """Drift makes the pairs weigh less. An aligned map follows the GPS, so it may not align itself by it."""
    short, _ = align((1.0, 0.1), drift_per_m=0.05)
    assert short is None
    first, second = align((6.0, 6.0), drift_per_m=0.05)
    assert first is not None
    assert first.yaw_rad == pytest.approx(0.0, abs=0.02)
    assert second == pytest.approx(first)


def test_a_map_with_matched_scans_is_aligned_on_and_on() -> None:
    early, _ = align((1.0, 0.1), drift_per_m=0.0)
    assert early is not None
    _, turned = align((6.0, 6.0), drift_per_m=0.0)
    assert turned is not None
    assert turned.yaw_rad < -0.1
