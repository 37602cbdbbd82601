"""Decode the packets of a YDLIDAR X4. Pure.

A packet has up to 40 points, the head's angles at the first and the last one, and a checksum; one of a single
point starts each revolution. The lidar triangulates: near points are seen under another angle, which the
manual's formula corrects. Source: YDLIDAR X4 development manual.
"""

import struct

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.lidar.point_packet import PointPacket
from thumper.lidar.rplidar_packets import STEP_MAX_DEG, STEP_MIN_DEG

HEADER = b"\xaa\x55"
MAX_POINTS = 80
LEAD_DEG = 7.0  # of the head before a point at 1.3 m; the formula gives 6.8 at 1 m and 8 far away
_HEAD = struct.Struct("<2sBBHHH")


class YdlidarDecoder:
    """Finds packets in a byte stream that may start anywhere and lose or change bytes."""

    sent_bytes = 90
    held_points = 0
    gap_points = 0.8

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._step_deg = 0.5
        self.bad_packets = 0

    def feed(self, data: bytes) -> list[PointPacket]:
        """Return the packets that `data` completes."""
        self._buffer += data
        packets = []
        start = 0
        while (start := self._buffer.find(HEADER, start)) >= 0 and len(self._buffer) - start >= _HEAD.size:
            _, _, points, first, last, _checksum = _HEAD.unpack_from(self._buffer, start)
            size = _HEAD.size + 2 * points
            is_sound = 1 <= points <= MAX_POINTS and first & last & 1
            if is_sound and len(self._buffer) - start < size:
                break
            words = np.frombuffer(bytes(self._buffer[start : start + size]), "<u2") if is_sound else None
            if words is None or np.bitwise_xor.reduce(words) != 0:  # the checksum included
                self.bad_packets += 1
                start += 1
                continue
            start += size
            packets.append(self._packet(first >> 1, last >> 1, words[_HEAD.size // 2 :]))
        # Without a header in the buffer, only the last byte can be the start of one.
        del self._buffer[: start if start >= 0 else max(len(self._buffer) - 1, 0)]
        return packets

    def _packet(self, first_q6: int, last_q6: int, words: FloatArray) -> PointPacket:
        if words.size > 1:
            step_deg = (last_q6 - first_q6) / 64.0 % 360.0 / (words.size - 1)
            self._step_deg = float(np.clip(step_deg, STEP_MIN_DEG, STEP_MAX_DEG))
        ranges_m = 0.25e-3 * words
        turned_deg = np.where(words > 0, angle_correction_deg(ranges_m) + LEAD_DEG, 0.0)
        return PointPacket(first_q6 / 64.0 - LEAD_DEG, self._step_deg, turned_deg, ranges_m)


def angle_correction_deg(ranges_m: FloatArray) -> FloatArray:
    """Return how far the points are from the head's angle [degrees], shape (n,); 0 for invalid ones."""
    mm = np.where(ranges_m > 0.0, 1e3 * ranges_m, 155.3)
    return np.rad2deg(np.arctan(21.8 * (155.3 - mm) / (155.3 * mm)))
