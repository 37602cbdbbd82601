"""Counting what is wrong with scans, so that none is dropped without a word."""

from collections import deque
from dataclasses import dataclass
from enum import StrEnum
from statistics import median
from typing import Annotated

import numpy as np
from annotated_types import Gt

from thumper.lidar.scan import Scan

PERIODS = 11  # steps whose median is the sensor's period: it follows a new rate after six scans
FAR_PERIODS = 5.0  # a gap is also this many periods long: a log may hold every fifth scan
BURST_PERIODS = 0.1
FARTHEST_S = 1e10  # no clock is 300 years from its epoch
LARGEST = 1e6  # of an angle [rad] or a time [s]


class ScanDefect(StrEnum):
    """What can be wrong with a scan; the text names the cause to look for."""

    BACKWARDS = "stamped before the scan before it; do two programs set the clock?"
    DUPLICATE = "with the same stamp as the scan before; is each sent twice, or the clock too coarse?"
    BURST = "came within a tenth of the usual period; is the reader stalled now and then?"
    GAP = "came after a gap; did the lidar stop and come back?"
    NO_ODOMETRY = "without odometry for its time; is the board silent, or its clock another?"
    WAITED = "dropped, having waited too long for odometry; is the board silent, or its clock another?"
    STAMP = "without a usable stamp; look at the driver"
    BEAMS = "without beams or their directions; look at the driver"
    EMPTY = "with too few usable beams; is the lidar covered or its range limit wrong?"
    ZEROS = "with zeros for ranges: taken as no reading, not as free space"


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanCheckOptions:
    """When a scan counts as odd."""

    gap_s: Annotated[float, Gt(0)] = 1.0  # a silence longer than this, and than five periods, is a gap
    fewest_beams: Annotated[int, Gt(0)] = 10


class ScanChecker:
    """Looks at every scan, counts, and says in one line a kind what was seen."""

    def __init__(self, options: ScanCheckOptions | None = None) -> None:
        self._options = options or ScanCheckOptions()
        self._last_s: float | None = None
        self._steps_s: deque[float] = deque(maxlen=PERIODS)
        self._longest_gap_s = 0.0
        self.scans = 0
        self.counts: dict[ScanDefect, int] = {}

    def count(self, flaw: ScanDefect) -> None:
        """Count a flaw that only the caller can know of."""
        self.counts[flaw] = self.counts.get(flaw, 0) + 1

    def check(self, scan: Scan) -> list[ScanDefect]:
        """Judge one scan in the order of arrival; returns what is odd about it, and counts it."""
        self.scans += 1
        found = [*self._time_flaws(scan.time_s), *self._beam_flaws(scan)]
        for flaw in found:
            self.count(flaw)
        return found

    def summary_by_kind(self) -> dict[str, str]:
        """One line for each kind of flaw, by its name, the most frequent first."""
        notes = {}
        for flaw, count in sorted(self.counts.items(), key=lambda item: -item[1]):
            longest = f" (the longest {self._longest_gap_s:.1f} s)" if flaw is ScanDefect.GAP else ""
            notes[flaw.name] = f"{count} of {self.scans} scans {flaw.value}{longest}"
        return notes

    def summary_lines(self) -> list[str]:
        """One line for each kind of flaw, the most frequent first."""
        return list(self.summary_by_kind().values())

    def _beam_flaws(self, scan: Scan) -> list[ScanDefect]:
        ranges_m, step_rad = scan.ranges_m, scan.angle_increment_rad
        directions = abs(scan.angle_min_rad) + abs(step_rad) + abs(scan.time_increment_s)
        if ranges_m.size == 0 or step_rad == 0.0 or not directions < LARGEST:  # nor is NaN
            return [ScanDefect.BEAMS]
        found = [ScanDefect.ZEROS] if np.any(ranges_m == 0.0) else []
        usable = (ranges_m >= scan.range_min_m) & ((ranges_m <= scan.range_max_m) | np.isposinf(ranges_m))
        if np.count_nonzero(usable) < self._options.fewest_beams:
            found.append(ScanDefect.EMPTY)
        return found

    def _time_flaws(self, time_s: float) -> list[ScanDefect]:
        if not abs(time_s) < FARTHEST_S:  # nor is NaN
            return [ScanDefect.STAMP]
        last_s, self._last_s = self._last_s, time_s
        if last_s is None:
            return []
        step_s = time_s - last_s
        if step_s < 0.0:
            return [ScanDefect.BACKWARDS]
        if step_s == 0.0:
            return [ScanDefect.DUPLICATE]
        period_s = median(self._steps_s) if self._steps_s else step_s
        self._steps_s.append(step_s)
        if step_s > max(self._options.gap_s, FAR_PERIODS * period_s):
            self._longest_gap_s = max(self._longest_gap_s, step_s)
            return [ScanDefect.GAP]
        return [ScanDefect.BURST] if step_s < BURST_PERIODS * period_s else []
