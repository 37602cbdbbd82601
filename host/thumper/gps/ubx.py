"""Read u-blox's binary protocol: positions from UBX-NAV-PVT, their accuracy from UBX-NAV-COV.

Source: u-blox F9 HPG 1.32 interface description, 3.2 (frames), 3.15.13 (NAV-PVT) and 3.15.3 (NAV-COV). Two
messages of fixed layout need no library.
"""

import struct
from dataclasses import dataclass, replace
from itertools import accumulate

from thumper.gps.fix import Fix, FixStatus
from thumper.gps.local_plane import LatLon

SYNC = b"\xb5b"
HEAD, TAIL = 6, 2  # sync, class, identity and length; checksum
LONGEST_BYTES = 4096  # of a frame: a longer length is damaged
NAV_PVT, NAV_COV = b"\x01\x07", b"\x01\x36"
MAX_VARIANCE_M2 = 1e12
PVT = struct.Struct("<I16xBB2xiii4xII")  # up to the vertical accuracy
COV = struct.Struct("<IxB10xf8xf4xf")
RTK_OF_CARRIER = {1: FixStatus.RTK_FLOAT, 2: FixStatus.RTK}  # carrSoln
GNSS_FIXES = (2, 3, 4)  # in the plane, in space, with dead reckoning; not 1, dead reckoning alone, or 5, time


@dataclass(frozen=True, slots=True, kw_only=True)
class UbxFrame:
    """Class and identity, and the payload."""

    kind: bytes
    payload: bytes

    @property
    def week_ms(self) -> int:
        """Time of the GPS week of a NAV message [ms]."""
        return int.from_bytes(self.payload[:4], "little")


class UbxSplitter:
    """Takes the frames out of a stream; NMEA may be between them."""

    def __init__(self) -> None:
        self._buffer = b""
        self.good, self.bad = 0, 0

    def feed(self, data: bytes) -> tuple[list[UbxFrame], bytes]:
        """Return the frames that end in these bytes, and what is not part of a frame."""
        self._buffer += data
        frames: list[UbxFrame] = []
        rest = b""
        while (start := self._buffer.find(SYNC)) >= 0:
            rest, self._buffer = rest + self._buffer[:start], self._buffer[start:]
            length = HEAD + int.from_bytes(self._buffer[4:6], "little") + TAIL
            if len(self._buffer) >= HEAD and length > LONGEST_BYTES:
                self._skip_sync()
            elif len(self._buffer) < HEAD or len(self._buffer) < length:
                return frames, rest
            elif checksum(self._buffer[2 : length - TAIL]) != self._buffer[length - TAIL : length]:
                self._skip_sync()
            else:
                frames.append(UbxFrame(kind=self._buffer[2:4], payload=self._buffer[HEAD : length - TAIL]))
                self.good += 1
                self._buffer = self._buffer[length:]
        kept = len(self._buffer) - self._buffer.endswith(SYNC[:1])
        rest, self._buffer = rest + self._buffer[:kept], self._buffer[kept:]
        return frames, rest

    def _skip_sync(self) -> None:
        self.bad += 1
        self._buffer = self._buffer[len(SYNC) :]


def checksum(data: bytes) -> bytes:
    """Return Fletcher's checksum of class, identity, length and payload (RFC 1145)."""
    return bytes((sum(data) & 0xFF, sum(accumulate(data)) & 0xFF))


def fix_of_pvt(payload: bytes, time_s: float) -> Fix | None:
    """Convert NAV-PVT; None if it is impossible.

    Its accuracies are those of both horizontal axes together, and of the height.
    """
    _, fix_type, flags, lon, lat, height_mm, horizontal_mm, vertical_mm = PVT.unpack_from(payload)
    if fix_type not in GNSS_FIXES or not flags & 1:
        return Fix(time_s=time_s)
    place = LatLon(1e-7 * lat, 1e-7 * lon)
    if not place.is_valid or horizontal_mm == 0:
        return None
    is_differential = flags & 2
    status = RTK_OF_CARRIER.get(flags >> 6, FixStatus.SBAS if is_differential else FixStatus.GPS)
    horizontal_m2 = (1e-3 * horizontal_mm) ** 2 / 2.0
    return Fix(
        time_s=time_s,
        status=status,
        latitude_deg=place.latitude_deg,
        longitude_deg=place.longitude_deg,
        altitude_m=1e-3 * height_mm,
        variances_m2=(horizontal_m2, horizontal_m2, (1e-3 * vertical_mm) ** 2),
    )


def with_cov(fix: Fix, payload: bytes) -> Fix:
    """Return the fix with the variances of its NAV-COV, if it has them."""
    _, is_valid, north_m2, east_m2, down_m2 = COV.unpack_from(payload)
    variances_m2 = (east_m2, north_m2, down_m2)
    if (
        fix.status is FixStatus.NONE
        or not is_valid
        or not all(0.0 < each < MAX_VARIANCE_M2 for each in variances_m2)
    ):
        return fix
    return replace(fix, variances_m2=variances_m2)
