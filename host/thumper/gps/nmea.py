"""Read NMEA 0183: positions from GGA, their accuracy from GST.

A receiver sends a burst of sentences per epoch. GST has the standard deviations; without it they follow from
GGA's dilution of precision and the kind of fix. Other sentences are checked and ignored.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import time
from typing import Any

from pynmeagps import (  # type: ignore[import-untyped]
    NMEAMessageError,
    NMEAParseError,
    NMEAReader,
    NMEATypeError,
    calc_checksum,
)

from thumper.gps.fix import Fix, FixStatus

SENTENCE = re.compile(rb"[!$]([A-Z][^*$!]*)\*([0-9A-Fa-f]{2})\r?")
LONGEST_BYTES = 4096  # without the end of a line: not NMEA
# Kinds of fix of GGA: status, and standard deviation at a dilution of precision of 1 [m]. An estimated
# position (6) is the receiver's own dead reckoning, and no measurement.
KINDS = {
    1: (FixStatus.GPS, 2.0),
    2: (FixStatus.SBAS, 1.0),
    3: (FixStatus.GPS, 2.0),
    4: (FixStatus.RTK, 0.02),
    5: (FixStatus.RTK_FLOAT, 0.5),
}
VERTICAL = 2.0  # times the horizontal standard deviation
MAX_NUMBER = 1e6  # of metres, or dilutions of precision


class SentenceDecoder:
    """Splits bytes into sentences; drops and counts those that are damaged or impossible."""

    def __init__(self) -> None:
        self._buffer = b""
        self.good, self.bad = 0, 0

    def feed(self, data: bytes) -> Iterator[Any]:
        """Yield pynmeagps's message for each GGA and GST that ends in these bytes."""
        *lines, self._buffer = (self._buffer + data).split(b"\n")
        if len(self._buffer) > LONGEST_BYTES:
            self._buffer = b""
            self.bad += 1
        for line in lines:
            start = max(line.rfind(b"$"), line.rfind(b"!"))
            if start < 0:
                continue  # between sentences: another protocol's bytes, or the end of the first one
            match = SENTENCE.fullmatch(line, start)
            if match is None or calc_checksum(match[1].decode("latin-1")) != match[2].decode().upper():
                self.bad += 1
            elif match[1][2:6] in {b"GGA,", b"GST,"}:
                message = _parse(match)
                self.good, self.bad = self.good + bool(message), self.bad + (not message)
                if message:
                    yield message
            else:
                self.good += 1


def _parse(sentence: re.Match[bytes]) -> Any:
    """Return pynmeagps's message; None if a field that the driver reads is missing or impossible."""
    try:
        message = NMEAReader.parse(b"$" + sentence[1] + b"*" + sentence[2] + b"\r\n")
        possible = _is_possible_gga(message) if message.msgID == "GGA" else _is_possible_gst(message)
    except (NMEAParseError, NMEAMessageError, NMEATypeError, AttributeError, ValueError):
        return None
    return message if possible else None


def _is_possible_gga(gga: Any) -> bool:
    if not all(_is_absent_or_number(value) for value in (gga.HDOP, gga.alt, gga.sep)):
        return False
    if gga.quality not in KINDS:
        return True  # no position
    return (
        isinstance(gga.time, time)
        and isinstance(gga.lat, float)
        and isinstance(gga.lon, float)
        and (abs(gga.lat) <= 90.0 and abs(gga.lon) <= 180.0)
        and (gga.NS in {"N", "S"} and gga.EW in {"E", "W"})
    )


def _is_possible_gst(gst: Any) -> bool:
    return all(_is_absent_or_number(std) for std in (gst.stdLong, gst.stdLat, gst.stdAlt))


def _is_absent_or_number(value: Any) -> bool:
    return value == "" or (isinstance(value, float) and abs(value) < MAX_NUMBER)


def fix_of_gga(gga: Any, time_s: float) -> Fix:
    """Convert a GGA sentence; its accuracy is a guess from the dilution of precision."""
    kind = KINDS.get(gga.quality)
    if kind is None:
        return Fix(time_s=time_s)
    status, std_m = kind
    dilution = gga.HDOP if isinstance(gga.HDOP, float) and gga.HDOP > 0.0 else 1.0
    variance_m2 = (std_m * dilution) ** 2
    altitude = [part for part in (gga.alt, gga.sep) if isinstance(part, float)]
    return Fix(
        time_s=time_s,
        status=status,
        latitude_deg=gga.lat,
        longitude_deg=gga.lon,
        altitude_m=sum(altitude) if altitude else math.nan,
        variances_m2=(variance_m2, variance_m2, VERTICAL**2 * variance_m2),
    )


def with_gst(fix: Fix, gst: Any) -> Fix:
    """Return the fix with the standard deviations of its GST sentence, where it has them."""
    stds_m = (gst.stdLong, gst.stdLat, gst.stdAlt)
    if fix.status is FixStatus.NONE or not all(isinstance(std, float) and std > 0.0 for std in stds_m):
        return fix
    east_m2, north_m2, up_m2 = (float(std) ** 2 for std in stds_m)
    return replace(fix, variances_m2=(east_m2, north_m2, up_m2))
