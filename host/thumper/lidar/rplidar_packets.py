"""Decode the three kinds of packets of RPLIDARs: legacy nodes, express and dense capsules. Pure.

A legacy node has 5 bytes and no checksum, only three check bits: bytes in mid node often look like one. So 16
nodes in succession make a packet. A capsule holds the angle of its first point only: the next capsule's angle
shows the step. Source: Slamtec LR001 (interface protocol).
"""

from collections.abc import Callable
from functools import reduce
from operator import xor

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.lidar.point_packet import PacketDecoder, PointPacket

STEP_MIN_DEG, STEP_MAX_DEG = 0.1, 3.0
LEAD_DEG = 7.0
"""An express capsule's angles lead by up to 8 degrees; how far exactly each point says."""

NODES = 16
_NODE = np.dtype([("flags", "u1"), ("angle", "<u2"), ("range", "<u2")])
_CABIN = np.dtype([("first", "<u2"), ("second", "<u2"), ("offsets", "u1")])
NODE_BYTES, CAPSULE_BYTES = 5, 84


class LegacyDecoder:
    """Decodes the nodes of a standard scan in packets of 16."""

    sent_bytes = NODE_BYTES
    held_points = 0
    gap_points = 10.0  # each node has its own corrected angle; the head's is unknown

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._is_aligned = True
        self.bad_packets = 0

    def feed(self, data: bytes) -> list[PointPacket]:
        """Return the packets that `data` completes."""
        self._buffer += data
        packets = []
        start, size = 0, NODES * NODE_BYTES
        while len(self._buffer) - start >= size:
            nodes = np.frombuffer(bytes(self._buffer[start : start + size]), _NODE)
            if np.all((nodes["flags"] ^ nodes["flags"] >> 1) & nodes["angle"] & 1):
                packets.append(_node_packet((nodes["angle"] >> 1) / 64.0, 0.25e-3 * nodes["range"]))
                start, self._is_aligned = start + size, True
            else:
                self.bad_packets += self._is_aligned
                start, self._is_aligned = start + 1, False
        del self._buffer[:start]
        return packets


def _node_packet(angles_deg: FloatArray, ranges_m: FloatArray) -> PointPacket:
    angles_deg = np.unwrap(angles_deg, period=360.0)
    order = np.arange(NODES)
    step_deg = float(np.clip(np.median(np.diff(angles_deg)), STEP_MIN_DEG, STEP_MAX_DEG))
    start_deg = float(np.median(angles_deg - step_deg * order))
    return PointPacket(start_deg, step_deg, angles_deg - (start_deg + step_deg * order), ranges_m)


class CapsuleDecoder:
    """Decodes capsules of 84 bytes; `unpack` returns lead [degrees] and range [m] of the points of one."""

    sent_bytes = CAPSULE_BYTES
    gap_points = 0.5

    def __init__(
        self, unpack: Callable[[bytes], tuple[FloatArray, FloatArray]], *, points: int, lead_deg: float
    ) -> None:
        self._unpack = unpack
        self._lead_deg = lead_deg  # of most points, so that head and points are at about the same angle
        self.held_points = points
        self._buffer = bytearray()
        self._waiting: tuple[float, FloatArray, FloatArray] | None = None
        self._step_deg: float | None = None
        self.bad_packets = 0

    def feed(self, data: bytes) -> list[PointPacket]:
        """Return the packets that `data` completes: the one before each complete capsule."""
        self._buffer += data
        packets = []
        start = 0
        while len(self._buffer) - start >= CAPSULE_BYTES:
            first, second = self._buffer[start : start + 2]
            if (first & 0xF0, second & 0xF0) != (0xA0, 0x50):
                start += 1
                continue
            content = bytes(self._buffer[start + 2 : start + CAPSULE_BYTES])
            if reduce(xor, content) != first & 0x0F | (second & 0x0F) << 4:
                self.bad_packets += 1
                start += 1
                continue
            start += CAPSULE_BYTES
            if (packet := self._add(content)) is not None:
                packets.append(packet)
        del self._buffer[:start]
        return packets

    def _add(self, content: bytes) -> PointPacket | None:
        """Return the waiting capsule with the step up to this one, which waits from now on."""
        angle = int.from_bytes(content[:2], "little")
        start_deg, is_first = (angle & 0x7FFF) / 64.0, angle >> 15
        before, self._waiting = self._waiting, (start_deg, *self._unpack(content[2:]))
        if before is None or is_first:  # a new scan: the angles start again
            return None
        before_deg, lead_deg, ranges_m = before
        step_deg = (start_deg - before_deg) % 360.0 / lead_deg.size
        if self._step_deg is not None and step_deg > 1.5 * self._step_deg:
            step_deg = self._step_deg  # capsules between the two were lost
        if not STEP_MIN_DEG <= step_deg <= STEP_MAX_DEG:
            return None
        self._step_deg = step_deg
        turned_deg = np.where(ranges_m > 0.0, self._lead_deg - lead_deg, 0.0)
        return PointPacket(before_deg - self._lead_deg, step_deg, turned_deg, ranges_m)


def _unpack_express(cabins: bytes) -> tuple[FloatArray, FloatArray]:
    """Unpack 16 cabins of two points: 14 bits of range [mm] and 6 bits of lead [1/8 degree] each."""
    table = np.frombuffer(cabins, _CABIN)
    words = np.column_stack([table["first"], table["second"]])
    low = np.column_stack([table["offsets"] & 0x0F, table["offsets"] >> 4])
    lead_deg = np.asarray((low | (words & 0x03) << 4).ravel() / 8.0, np.float64)
    return lead_deg, np.asarray(1e-3 * (words >> 2).ravel(), np.float64)


def _unpack_dense(cabins: bytes) -> tuple[FloatArray, FloatArray]:
    """Unpack 40 ranges [mm]; nothing leads."""
    ranges_m = np.asarray(1e-3 * np.frombuffer(cabins, "<u2"), np.float64)
    return np.zeros(ranges_m.size), ranges_m


def legacy_decoder() -> PacketDecoder:
    """Return a decoder of standard scans."""
    return LegacyDecoder()


def express_decoder() -> PacketDecoder:
    """Return a decoder of express scans of the A series."""
    return CapsuleDecoder(_unpack_express, points=32, lead_deg=LEAD_DEG)


def dense_decoder() -> PacketDecoder:
    """Return a decoder of express scans of the C series."""
    return CapsuleDecoder(_unpack_dense, points=40, lead_deg=0.0)
