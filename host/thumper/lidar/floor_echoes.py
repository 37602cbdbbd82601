"""Drop echoes of the floor: a base that brakes hard tilts, and the lidar sees the floor ahead. Pure."""

from dataclasses import replace

import numpy as np

from thumper.lidar.scan import Scan

TILTING_M_S2 = 0.8
"""Normal driving accelerates and brakes less: `SpeedLimits.v_accel_m_s2` is 0.4, the board's ramp 0.5."""

SETTLING_S = 0.5
"""The springs of a small chassis come to rest in this time: 3 Hz, lightly damped."""

FLOOR_M = 2.5
"""No floor is nearer: a lidar 0.2 m above it sees it at this distance when tilted by 4.6 degrees."""


class FloorEchoFilter:
    """Marks far beams as invalid while the base may be tilted."""

    def __init__(self) -> None:
        self._time_s = self._speed_m_s = 0.0
        self._tilted_s = -np.inf

    def add_speed(self, time_s: float, speed_m_s: float) -> None:
        """Add the forward speed at a time; both come in the order of time."""
        elapsed_s, change_m_s = time_s - self._time_s, speed_m_s - self._speed_m_s
        self._time_s, self._speed_m_s = time_s, speed_m_s
        if elapsed_s > 0.0 and abs(change_m_s) > TILTING_M_S2 * elapsed_s:
            self._tilted_s = time_s

    def filter(self, scan: Scan) -> Scan:
        """Return the scan with NaN for the far beams if the base braked hard during it or just before."""
        if scan.time_s > self._tilted_s + SETTLING_S:
            return scan
        return replace(scan, ranges_m=np.where(scan.ranges_m > FLOOR_M, np.nan, scan.ranges_m))
