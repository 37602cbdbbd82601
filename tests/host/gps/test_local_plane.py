"""The tangent plane agrees with PROJ, and there and back is the same place."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Transformer

from thumper.gps.local_plane import EastNorth, LatLon, LocalPlane

latitudes, longitudes = st.floats(-85.0, 85.0), st.floats(-180.0, 180.0)
offsets_m = st.floats(-5000.0, 5000.0)


@given(latitudes, longitudes, offsets_m, offsets_m)
def test_it_agrees_with_proj(latitude: float, longitude: float, east_m: float, north_m: float) -> None:
    plane = LocalPlane(LatLon(latitude, longitude))
    place = plane.to_earth(EastNorth(east_m, north_m))
    proj = Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 "
        f"+step +proj=topocentric +ellps=WGS84 +lon_0={longitude!r} +lat_0={latitude!r} +h_0=0"
    )
    known = proj.transform(place.longitude_deg, place.latitude_deg, 0.0)[:2]
    assert tuple(plane.to_plane(place)) == pytest.approx(known, abs=1e-6)
    assert tuple(plane.to_plane(place)) == pytest.approx((east_m, north_m), abs=1e-6)


def test_a_place_beyond_the_plane_is_refused() -> None:
    plane = LocalPlane(LatLon(48.0, 11.0))
    for east_m in (2e5, math.inf, math.nan):
        with pytest.raises(ValueError, match="km from the datum"):
            plane.to_earth(EastNorth(east_m, 0.0))
