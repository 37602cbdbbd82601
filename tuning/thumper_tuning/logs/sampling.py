"""Sort the rows of a log by time and find its gaps. Pure functions."""

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper_tuning.logs.motor_log import BoolArray

IntArray = NDArray[np.intp]

# Sampling is regular if the 90th percentile of the periods is less than this many times the 10th.
# Then a gap is one lost row.
REGULAR_RATIO = 1.6
GAP_REGULAR, GAP_IRREGULAR = 1.7, 6.0  # periods longer than this many medians are gaps


def sort_rows(time_s: FloatArray, measured: BoolArray) -> tuple[IntArray, BoolArray, list[str]]:
    """Return the rows to keep in time order, where segments start, and warnings.

    If time falls back by a few rows, the rows were out of order and are sorted. If it falls back further, the
    clock restarted and a new segment starts. Of several rows at the same time, the first with an output is
    kept; `measured` marks these.
    """
    warnings: list[str] = []
    steps = np.diff(time_s)
    between = np.diff(time_s[measured])  # other rows may hold the drive alone
    between = between if (between > 0).any() else steps
    period_s = float(np.median(between[between > 0]))
    restarts = np.flatnonzero(steps < -10.0 * period_s) + 1
    order: list[int] = []
    starts: list[bool] = []
    unordered = repeated = gap_count = 0
    for part in np.split(np.arange(len(time_s)), restarts):
        ranks = np.lexsort((~measured[part], time_s[part]))
        unordered += int(np.sum(np.diff(time_s[part]) < 0))
        kept = part[ranks]
        is_new_time = np.concatenate(([True], np.diff(time_s[kept]) > 1e-3 * period_s))
        repeated += int(np.sum(~is_new_time))
        kept = kept[is_new_time]
        gaps = _gaps(np.diff(time_s[kept]), period_s)
        gap_count += int(gaps.sum())
        order.extend(kept.tolist())
        starts.extend([True, *gaps.tolist()])
    if unordered:
        warnings.append(f"{unordered} rows were out of order: sorted by time")
    if repeated:
        warnings.append(f"{repeated} rows repeat a time: dropped")
    if gap_count:
        warnings.append(f"{gap_count} gaps in time: the motor's state is estimated again after each")
    if len(restarts):
        warnings.append(f"the clock restarts {len(restarts)} times: read as {len(restarts) + 1} runs")
    return np.array(order, dtype=np.intp), np.array(starts, dtype=bool), warnings


def _gaps(steps: FloatArray, period_s: float) -> BoolArray:
    low, high = np.percentile(steps, (10, 90)) if len(steps) else (1.0, 1.0)
    factor = GAP_REGULAR if high < REGULAR_RATIO * low else GAP_IRREGULAR
    result: BoolArray = steps > factor * period_s
    return result
