"""A packet of points as all spinning lidars send them, and what its decoders have in common. Pure."""

from typing import NamedTuple, Protocol

from thumper.common.geometry import FloatArray


class PointPacket(NamedTuple):
    """Points at a fixed rate. Angles are clockwise [degrees].

    The head is at `start_deg + i * step_deg` at point i. The point itself is `turned_deg[i]` further, shape
    (n,): a lidar that triangulates sees near points under another angle than far ones. A range of 0 is
    invalid.
    """

    start_deg: float
    step_deg: float
    turned_deg: FloatArray
    ranges_m: FloatArray


class PacketDecoder(Protocol):
    """Finds packets in a byte stream that may start anywhere and lose or change bytes."""

    bad_packets: int  # damaged ones
    sent_bytes: int  # sent after the last point of a packet
    held_points: int  # a packet is returned only after so many more points
    gap_points: float  # a smaller gap between packets is not one: the angles are not that exact

    def feed(self, data: bytes) -> list[PointPacket]:
        """Return the packets that `data` completes."""
        ...
