"""Bytes on the wire from a simulated lidar to the host."""

from collections import deque


class Outbox:
    """Packets with their arrival times; packets arrive in the order in which they were sent."""

    def __init__(self) -> None:
        self._packets: deque[tuple[float, bytes]] = deque()

    def send(self, data: bytes, arrival_s: float) -> None:
        """Send bytes that the host can read from `arrival_s` on."""
        self._packets.append((arrival_s, data))

    def arrived(self, now_s: float) -> bytes:
        """Remove and return the bytes that have arrived at `now_s`."""
        parts = []
        while self._packets and self._packets[0][0] <= now_s:
            parts.append(self._packets.popleft()[1])
        return b"".join(parts)
