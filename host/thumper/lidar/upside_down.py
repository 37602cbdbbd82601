"""A lidar that is mounted the other way up."""

from thumper.common.closable import Closable
from thumper.common.sensor import SensorCounters
from thumper.lidar.driver import LidarDriver
from thumper.lidar.scan import Scan


class UpsideDownLidar(Closable):
    """Passes on the scans of a driver with left and right exchanged."""

    def __init__(self, driver: LidarDriver) -> None:
        self._driver = driver

    @property
    def counters(self) -> SensorCounters:
        """The driver's counters."""
        return self._driver.counters

    def poll(self) -> list[Scan]:
        """Return the scans that have arrived since the last call, oldest first."""
        return [scan.upside_down() for scan in self._driver.poll()]

    def wait_for_sample(self, timeout_s: float) -> Scan:
        """Wait for the next scan; raise `ThumperError` if none arrives in time."""
        return self._driver.wait_for_sample(timeout_s).upside_down()

    def now_s(self) -> float:
        """Return the time [s] on the clock of the scan stamps."""
        return self._driver.now_s()

    def close(self) -> None:
        """Close the driver."""
        self._driver.close()
