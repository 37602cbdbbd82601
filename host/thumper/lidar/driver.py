"""The interface of all lidar drivers."""

from dataclasses import dataclass
from typing import Protocol

from thumper.lidar.scan import Scan


@dataclass(slots=True, kw_only=True)
class LidarCounters:
    """Events on the line since the start."""

    scans: int = 0
    bad_replies: int = 0  # replies or frames that fail their checksum
    restarts: int = 0
    port_errors: int = 0


class LidarDriver(Protocol):
    """A streaming lidar. The constructor starts it; `poll` never waits and never raises."""

    @property
    def counters(self) -> LidarCounters:
        """Events on the line since the start."""
        ...

    def poll(self) -> list[Scan]:
        """Return the scans that have arrived since the last call, oldest first."""
        ...

    def wait_for_scan(self, timeout_s: float) -> Scan:
        """Wait for the next scan; raise `ThumperError` if none arrives in time."""
        ...

    def now_s(self) -> float:
        """Return the time [s] on the clock of the scan stamps."""
        ...

    def close(self) -> None:
        """Close the port, even if the device is gone."""
        ...
