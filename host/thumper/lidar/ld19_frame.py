"""The one-way protocol of the LDROBOT LD19 and LD06: 47-byte frames of 12 points each. Pure: no port.

Little-endian: 54 2C, speed [deg/s], start angle [0.01 deg], 12 x (distance [mm], intensity), end angle,
time stamp [ms, wraps at 30 000], CRC-8 with the polynomial 0x4D over all before it. Angles rise clockwise.
"""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

HEADER = b"\x54\x2c"
FRAME_BYTES = 47
POINTS = 12
STAMP_WRAP_MS = 30_000
FULL_TURN_DEG = 360.0
STEP_MIN_DEG, STEP_MAX_DEG = 0.2, 2.0
"""Between two points of a head at 5 ... 13 turns a second it is 0.4 ... 1.04 degrees."""

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
    """Twelve points, evenly spaced from `start_deg` clockwise; a range of 0 is no return."""

    speed_deg_s: int
    start_deg: float
    step_deg: float
    ranges_mm: NDArray[np.uint16]  # shape (12,)
    intensities: NDArray[np.uint8]  # shape (12,)
    stamp_ms: int


def crc8(data: bytes) -> int:
    """The check byte of `data`."""
    crc = 0
    for byte in data:
        crc = _CRC_TABLE[crc ^ byte]
    return crc


class FrameCutter:
    """Finds frames in a byte stream, wherever it starts and whatever is lost or damaged in it."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.bad_frames = 0  # began like a frame and did not check

    def feed(self, data: bytes) -> list[Ld19Frame]:
        """Return the frames that `data` completes."""
        self._buffer += data
        frames = []
        start = 0
        while (start := self._buffer.find(HEADER, start)) >= 0 and len(self._buffer) - start >= FRAME_BYTES:
            frame = _parse(bytes(self._buffer[start : start + FRAME_BYTES]))
            if frame is None:
                self.bad_frames += 1
                start += 1  # the header may have been two bytes of something else
            else:
                frames.append(frame)
                start += FRAME_BYTES
        # Without a header only the last byte can still begin one.
        del self._buffer[: start if start >= 0 else max(len(self._buffer) - 1, 0)]
        return frames


def _parse(raw: bytes) -> Ld19Frame | None:
    """Read one frame; None if its check byte or its angles are wrong."""
    _, speed_deg_s, start, points, end, stamp_ms, crc = _ENDS.unpack(raw)
    if crc != crc8(raw[:-1]):
        return None
    step_deg = 0.01 * (end - start) % FULL_TURN_DEG / (POINTS - 1)
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
