"""Count defective scans by kind, so that every dropped scan is reported."""

from collections import deque
from dataclasses import dataclass
from enum import StrEnum
from statistics import median
from typing import Annotated

import numpy as np
from annotated_types import Gt

from thumper.lidar.scan import Scan

PERIODS = 11  # the period is the median of these steps, so it follows a new rate after six scans
GAP_PERIODS = 5.0  # a gap is also longer than this many periods: a log may hold only every fifth scan
BURST_PERIODS = 0.1
LARGEST_STAMP_S = 1e10  # no clock is 300 years from its epoch
LARGEST = 1e6  # of an angle [rad] or a time [s]


class ScanDefect(StrEnum):
    """Defects of a scan; the text names the likely cause."""

    BACKWARDS = "stamped before the previous scan; do two programs set the clock?"
    DUPLICATE = "with the stamp of the previous scan; is each scan sent twice, or the clock too coarse?"
    BURST = "arrived within a tenth of the usual period; does the reader stall now and then?"
    GAP = "arrived after a gap; did the lidar stop and restart?"
    NO_ODOMETRY = "without odometry for their time; is the board silent, or its clock wrong?"
    WAITED = "dropped after waiting too long for odometry; is the board silent, or its clock wrong?"
    STAMP = "without a usable stamp; check the driver"
    BEAMS = "without beams or beam directions; check the driver"
    EMPTY = "with too few usable beams: open ground, a covered lidar, or a range limit that is too low"
    ZEROS = "with zeros for ranges: read as invalid, not as free space"


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanCheckOptions:
    """Limits beyond which a scan counts as defective."""

    gap_s: Annotated[float, Gt(0)] = 1.0  # a pause longer than this and than five periods is a gap [s]
    fewest_beams: Annotated[int, Gt(0)] = 10


class ScanChecker:
    """Checks every scan, counts the defects, and summarizes them in one line per kind."""

    def __init__(self, options: ScanCheckOptions | None = None) -> None:
        self._options = options or ScanCheckOptions()
        self._last_s: float | None = None
        self._steps_s: deque[float] = deque(maxlen=PERIODS)
        self._longest_gap_s = 0.0
        self.scans = 0
        self.counts: dict[ScanDefect, int] = {}

    def count(self, defect: ScanDefect) -> None:
        """Count a defect that only the caller can detect."""
        self.counts[defect] = self.counts.get(defect, 0) + 1

    def check(self, scan: Scan) -> list[ScanDefect]:
        """Return the defects of a scan and count them. Call it in the order of arrival."""
        self.scans += 1
        found = [*self._time_defects(scan.time_s), *self._beam_defects(scan)]
        for defect in found:
            self.count(defect)
        return found

    def summary_by_kind(self) -> dict[str, str]:
        """Return one line for each kind of defect, by its name, the most frequent first."""
        notes = {}
        for defect, count in sorted(self.counts.items(), key=lambda item: -item[1]):
            longest = f" (the longest {self._longest_gap_s:.1f} s)" if defect is ScanDefect.GAP else ""
            notes[defect.name] = f"{count} of {self.scans} scans {defect.value}{longest}"
        return notes

    def summary_lines(self) -> list[str]:
        """Return one line for each kind of defect, the most frequent first."""
        return list(self.summary_by_kind().values())

    def _beam_defects(self, scan: Scan) -> list[ScanDefect]:
        ranges_m, step_rad = scan.ranges_m, scan.angle_increment_rad
        directions = abs(scan.angle_min_rad) + abs(step_rad) + abs(scan.time_increment_s)
        if ranges_m.size == 0 or step_rad == 0.0 or not directions < LARGEST:  # also true for NaN
            return [ScanDefect.BEAMS]
        found = [ScanDefect.ZEROS] if np.any(ranges_m == 0.0) else []
        usable = (ranges_m >= scan.range_min_m) & ((ranges_m <= scan.range_max_m) | np.isposinf(ranges_m))
        if np.count_nonzero(usable) < self._options.fewest_beams:
            found.append(ScanDefect.EMPTY)
        return found

    def _time_defects(self, time_s: float) -> list[ScanDefect]:
        if not abs(time_s) < LARGEST_STAMP_S:  # also true for NaN
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
        if step_s > max(self._options.gap_s, GAP_PERIODS * period_s):
            self._longest_gap_s = max(self._longest_gap_s, step_s)
            return [ScanDefect.GAP]
        return [ScanDefect.BURST] if step_s < BURST_PERIODS * period_s else []
