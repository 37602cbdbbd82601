"""What every lidar driver offers, whatever the sensor speaks."""

from dataclasses import dataclass
from typing import Protocol

from thumper.lidar.scan import Scan


@dataclass(slots=True, kw_only=True)
class LidarCounters:
    """What has happened on the line since the start."""

    scans: int = 0
    bad_replies: int = 0  # or frames: whatever the sensor sends that does not check
    restarts: int = 0
    port_errors: int = 0


class LidarDriver(Protocol):
    """A lidar that streams. It is awake once it exists; `poll` never waits and never raises."""

    counters: LidarCounters

    def poll(self) -> list[Scan]:
        """Return the scans that have arrived since the last call, oldest first."""
        ...

    def wait_for_scan(self, timeout_s: float) -> Scan:
        """Wait for the next scan; raises `ThumperError` when none comes in time."""
        ...

    def now_s(self) -> float:
        """The clock that the scans are stamped on."""
        ...

    def close(self) -> None:
        """Close the port; a port that has gone is no error."""
        ...
