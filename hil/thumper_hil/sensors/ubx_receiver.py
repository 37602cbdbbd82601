"""Simulate a ZED-F9P that sends UBX-NAV-PVT and UBX-NAV-COV at each epoch, instead of NMEA.

Source: u-blox F9 HPG 1.32 interface description, 3.15.13 and 3.15.3.
"""

import math
import struct

from thumper.gps.local_plane import LatLon
from thumper_hil.sensors.gnss_receiver import ALTITUDE_M, GEOID_M, FixKind, GnssReceiver

PVT, COV = struct.Struct("<IH6BIi4B4i2I5i2I2H4xihH"), struct.Struct("<I3B9x12f")
NO_FIX, FIX_3D = 0, 3
FIX_OK, DIFFERENTIAL, CARRIER_SHIFT = 1, 2, 6
CARRIER = {5: 1, 4: 2}  # carrier solution with floating and with fixed ambiguities, by the quality of GGA
ALL_VALID = 7  # date, time, fully resolved
FAR_MM = 4_294_967_295  # accuracy without a fix


class UbxReceiver(GnssReceiver):
    """The device."""

    def _fix(self, day_s: float, at: LatLon, kind: FixKind) -> tuple[bytes, ...]:
        flags = FIX_OK | DIFFERENTIAL * (kind.quality > 1) | CARRIER.get(kind.quality, 0) << CARRIER_SHIFT
        horizontal_m, vertical_m = math.sqrt(2.0) * kind.std_m, 2.0 * kind.std_m
        return (
            _pvt(day_s, FIX_3D, flags, at, _mm(horizontal_m), _mm(vertical_m)),
            _cov(day_s, kind.std_m**2, vertical_m**2),
        )

    def _no_fix(self, day_s: float) -> tuple[bytes, ...]:
        return (_pvt(day_s, NO_FIX, 0, LatLon(0.0, 0.0), FAR_MM, FAR_MM), _cov(day_s, 0.0, 0.0))


def frame(kind: bytes, payload: bytes) -> bytes:
    """Return the frame with its checksum, Fletcher's of 8 bits."""
    content = kind + struct.pack("<H", len(payload)) + payload
    first = second = 0
    for byte in content:
        first = (first + byte) % 256
        second = (second + first) % 256
    return b"\xb5\x62" + content + bytes((first, second))


def _mm(value_m: float) -> int:
    return round(1e3 * value_m)


def _pvt(day_s: float, fix: int, flags: int, at: LatLon, horizontal_mm: int, vertical_mm: int) -> bytes:
    second = round(day_s)
    payload = PVT.pack(
        *(round(1e3 * day_s), 2026, 6, 1, second // 3600 % 24, second // 60 % 60, second % 60, ALL_VALID),
        *(30, round(1e9 * (day_s - second)), fix, flags, 0xEA, 12 if fix else 0),
        *(round(1e7 * at.longitude_deg), round(1e7 * at.latitude_deg)),
        *(_mm(ALTITUDE_M + GEOID_M), _mm(ALTITUDE_M), horizontal_mm, vertical_mm),
        *(0, 0, 0, 0, 0, 0, 18_000_000, 140, 0, 0, 0, 0),
    )
    return frame(b"\x01\x07", payload)


def _cov(day_s: float, horizontal_m2: float, vertical_m2: float) -> bytes:
    is_valid = int(horizontal_m2 > 0.0)
    position = (horizontal_m2, 0.0, 0.0, horizontal_m2, 0.0, vertical_m2)
    return frame(b"\x01\x36", COV.pack(round(1e3 * day_s), 0, is_valid, is_valid, *position, *6 * (0.0,)))
