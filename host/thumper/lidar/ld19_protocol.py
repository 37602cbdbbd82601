"""Decode the LD19's frames and assemble them to full revolutions. Pure: no port, no clock.

The sensor measures at a fixed rate. So the index of a point within a revolution determines its time and, if
the head turns steadily, its angle. Straight lines fitted to the frames give both, and average out the
resolution of the stamps (1 ms) and angles (0.01 deg). Lost frames leave indices without a point.
"""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray

HEADER = b"\x54\x2c"
FRAME_BYTES = 47
POINTS = 12
STAMP_WRAP_MS = 30_000
REVOLUTION_DEG = 360.0
STEP_MIN_DEG, STEP_MAX_DEG = 0.2, 2.0
"""The step between two points is 0.4 ... 1.04 degrees at 5 ... 13 revolutions per second."""

_ENDS = struct.Struct("<2sHH36sHHB")
_POINT = np.dtype([("range_mm", "<u2"), ("intensity", "u1")])


def _crc_table() -> bytes:
    table = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x4D) & 0xFF if crc & 0x80 else crc << 1
        table.append(crc)
    return bytes(table)


_CRC_TABLE = _crc_table()


@dataclass(frozen=True, slots=True, kw_only=True)
class Ld19Frame:
    """Twelve points, evenly spaced clockwise from `start_deg`; a range of 0 means no return."""

    speed_deg_s: int
    start_deg: float
    step_deg: float
    ranges_mm: NDArray[np.uint16]  # shape (12,)
    intensities: NDArray[np.uint8]  # shape (12,)
    stamp_ms: int


def crc8(data: bytes) -> int:
    """Return the CRC-8 of `data`."""
    crc = 0
    for byte in data:
        crc = _CRC_TABLE[crc ^ byte]
    return crc


class Ld19Decoder:
    """Finds frames in a byte stream that may start anywhere and lose or change bytes."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.bad_frames = 0  # a header, but a wrong CRC or impossible angles

    def feed(self, data: bytes) -> list[Ld19Frame]:
        """Return the frames that `data` completes."""
        self._buffer += data
        frames = []
        start = 0
        while (start := self._buffer.find(HEADER, start)) >= 0 and len(self._buffer) - start >= FRAME_BYTES:
            frame = _parse(bytes(self._buffer[start : start + FRAME_BYTES]))
            if frame is None:
                self.bad_frames += 1
                start += 1  # the header may have been two bytes of data
            else:
                frames.append(frame)
                start += FRAME_BYTES
        # Without a header in the buffer, only the last byte can be the start of one.
        del self._buffer[: start if start >= 0 else max(len(self._buffer) - 1, 0)]
        return frames


def _parse(raw: bytes) -> Ld19Frame | None:
    """Return the frame, or None if its CRC or its angles are wrong."""
    _, speed_deg_s, start, points, end, stamp_ms, crc = _ENDS.unpack(raw)
    if crc != crc8(raw[:-1]):
        return None
    step_deg = 0.01 * (end - start) % REVOLUTION_DEG / (POINTS - 1)
    if not STEP_MIN_DEG <= step_deg <= STEP_MAX_DEG:
        return None
    table = np.frombuffer(points, _POINT)
    return Ld19Frame(
        speed_deg_s=speed_deg_s,
        start_deg=0.01 * start,
        step_deg=step_deg,
        ranges_mm=table["range_mm"],
        intensities=table["intensity"],
        stamp_ms=stamp_ms,
    )


SEAM_DEG = 180.0
"""A revolution starts and ends behind the robot, so that one sweep covers everything ahead of it."""

GAP_MAX_S = 0.05
"""After half a revolution without frames the number of lost points is a guess; start again."""

MIN_SHARE = 0.5
"""Drop a revolution with a smaller share of its points."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Revolution:
    """One clockwise revolution; point i is at `first_deg + i * step_deg`, measured at `i * point_s`."""

    time_s: float
    point_s: float
    first_deg: float
    step_deg: float
    ranges_mm: NDArray[np.uint16]  # shape (n,); 0 is no return
    intensities: NDArray[np.uint8]  # shape (n,)
    known: NDArray[np.bool_]  # shape (n,); False where a frame was lost


@dataclass(frozen=True, slots=True, kw_only=True)
class _Segment:
    """The points that one frame adds to a revolution."""

    indices: NDArray[np.int64]
    angles_deg: FloatArray  # from the seam, rising past 360
    times_s: FloatArray
    ranges_mm: NDArray[np.uint16]
    intensities: NDArray[np.uint8]

    def select(self, chosen: NDArray[np.bool_], offset_deg: float) -> "_Segment":
        return _Segment(
            indices=self.indices[chosen],
            angles_deg=self.angles_deg[chosen] - offset_deg,
            times_s=self.times_s[chosen],
            ranges_mm=self.ranges_mm[chosen],
            intensities=self.intensities[chosen],
        )


class RevolutionAssembler:
    """Collects frames; returns a revolution with the frame that completes it."""

    def __init__(self) -> None:
        self._segments: list[_Segment] = []
        self._is_whole = False  # false until the seam has been passed
        self._stamped_s: float | None = None
        self._next_index = 0
        self._end_deg = 0.0

    def feed(self, frame: Ld19Frame, last_point_s: float, point_s: float) -> Revolution | None:
        """Add a frame whose last point was measured at `last_point_s`, with points `point_s` apart."""
        start_deg = (frame.start_deg - SEAM_DEG) % REVOLUTION_DEG
        first_index = self._next_index
        if self._stamped_s is None or not 0.0 <= last_point_s - self._stamped_s <= GAP_MAX_S:
            self._segments, self._is_whole = [], False
        else:
            gap_deg = (start_deg - self._end_deg) % REVOLUTION_DEG
            lost = max(round(gap_deg / frame.step_deg) - 1, 0)
            if lost > REVOLUTION_DEG / frame.step_deg / 2:  # the angle stepped back a little: not a gap
                lost, gap_deg = 0, frame.step_deg
            first_index += lost
            start_deg = self._end_deg + gap_deg
        order = np.arange(POINTS)
        segment = _Segment(
            indices=first_index + order,
            angles_deg=np.asarray(start_deg + frame.step_deg * order, np.float64),
            times_s=np.asarray(last_point_s - point_s * order[::-1], np.float64),
            ranges_mm=frame.ranges_mm,
            intensities=frame.intensities,
        )
        self._next_index = first_index + POINTS
        self._stamped_s = last_point_s
        self._end_deg = float(segment.angles_deg[-1])
        if self._end_deg < REVOLUTION_DEG:
            self._segments.append(segment)
            return None
        self._end_deg -= REVOLUTION_DEG
        beyond = segment.angles_deg >= REVOLUTION_DEG
        self._segments.append(segment.select(~beyond, 0.0))
        revolution = self._finish() if self._is_whole else None
        self._segments, self._is_whole = [segment.select(beyond, REVOLUTION_DEG)], True
        return revolution

    def _finish(self) -> Revolution | None:
        indices = np.concatenate([segment.indices for segment in self._segments])
        places = indices - indices[0]
        beams = int(places[-1]) + 1
        if places.size < MIN_SHARE * beams:
            return None
        angles_deg = np.concatenate([segment.angles_deg for segment in self._segments])
        times_s = np.concatenate([segment.times_s for segment in self._segments])
        step_deg, first_deg = np.polyfit(places, angles_deg, 1)
        point_s, after_s = np.polyfit(places, times_s - times_s[0], 1)
        ranges_mm, intensities = np.zeros(beams, np.uint16), np.zeros(beams, np.uint8)
        known = np.zeros(beams, np.bool_)
        ranges_mm[places] = np.concatenate([segment.ranges_mm for segment in self._segments])
        intensities[places] = np.concatenate([segment.intensities for segment in self._segments])
        known[places] = True
        return Revolution(
            time_s=float(times_s[0] + after_s),
            point_s=float(point_s),
            first_deg=float(first_deg) + SEAM_DEG,
            step_deg=float(step_deg),
            ranges_mm=ranges_mm,
            intensities=intensities,
            known=known,
        )
