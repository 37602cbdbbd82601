"""Counting what is wrong with scans, so that none is dropped without a word."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

import numpy as np
from annotated_types import Gt

from thumper.lidar.scan import Scan


class Flaw(StrEnum):
    """What can be wrong with a scan; the text names the cause to look for."""

    BACKWARDS = "stamped before the scan before it; do two programs set the clock?"
    BURST = "came within a tenth of the usual period; is the reader stalled now and then?"
    GAP = "came after a gap; did the lidar stop and come back?"
    NO_ODOMETRY = "without odometry for its time; is the board silent, or its clock another?"
    QUEUE_FULL = "dropped, the oldest of a full queue; is odometry late?"
    STAMP = "without a usable stamp; look at the driver"
    EMPTY = "with too few usable beams; is the lidar covered or its range limit wrong?"
    ZEROS = "with zeros for ranges: taken as no reading, not as free space"


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorOptions:
    """When a scan counts as odd."""

    gap_s: Annotated[float, Gt(0)] = 1.0  # a silence longer than this is a gap
    fewest_beams: Annotated[int, Gt(0)] = 10


class InputMonitor:
    """Looks at every scan, counts, and says in one line a kind what was seen."""

    def __init__(self, options: MonitorOptions | None = None) -> None:
        self._options = options or MonitorOptions()
        self._last_s: float | None = None
        self._period_s = 0.0
        self.scans = 0
        self.counts: dict[Flaw, int] = {}

    def note(self, flaw: Flaw) -> None:
        """Count a flaw that only the caller can know of."""
        self.counts[flaw] = self.counts.get(flaw, 0) + 1

    def look(self, scan: Scan) -> list[Flaw]:
        """Judge one scan in the order of arrival; returns what is odd about it, and counts it."""
        self.scans += 1
        found = [*self._time_flaws(scan.time_s)]
        ranges_m = scan.ranges_m
        if np.any(ranges_m == 0.0):
            found.append(Flaw.ZEROS)
        usable = (ranges_m >= scan.range_min_m) & ((ranges_m <= scan.range_max_m) | np.isposinf(ranges_m))
        if np.count_nonzero(usable) < self._options.fewest_beams:
            found.append(Flaw.EMPTY)
        for flaw in found:
            self.note(flaw)
        return found

    def lines(self) -> list[str]:
        """One line for each kind of flaw, the most frequent first."""
        ordered = sorted(self.counts.items(), key=lambda item: -item[1])
        return [f"{count} of {self.scans} scans {flaw.value}" for flaw, count in ordered]

    def _time_flaws(self, time_s: float) -> list[Flaw]:
        if not np.isfinite(time_s):
            return [Flaw.STAMP]
        last_s, self._last_s = self._last_s, time_s
        if last_s is None:
            return []
        step_s = time_s - last_s
        if step_s < 0.0:
            return [Flaw.BACKWARDS]
        if step_s > self._options.gap_s:
            return [Flaw.GAP]
        if self._period_s and step_s < 0.1 * self._period_s:
            return [Flaw.BURST]
        # Bursts and gaps left out, the mean of about ten steps is the sensor's period.
        self._period_s = step_s if not self._period_s else 0.9 * self._period_s + 0.1 * step_s
        return []
