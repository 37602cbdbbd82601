"""Put rows into the order of time, and find where a log breaks off. Pure."""

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper_tuning.logs.motor_log import BoolArray

IntArray = NDArray[np.intp]

REGULAR_SPREAD = 1.6  # 90th over 10th percentile of the steps below this: a steady beat, a gap is a lost row
GAP_REGULAR, GAP_IRREGULAR = 1.7, 6.0  # steps longer than this many medians are gaps


def order_rows(time_s: FloatArray) -> tuple[IntArray, BoolArray, list[str]]:
    """Return which rows to keep in which order, where stretches begin, and what was found.

    A time that falls back by a few rows is rows out of order: they are sorted. One that falls back
    further is a
    clock that started again: a new stretch. Of rows at one time the first is kept.
    """
    notes: list[str] = []
    steps = np.diff(time_s)
    period_s = float(np.median(steps[steps > 0]))
    restarts = np.flatnonzero(steps < -10.0 * period_s) + 1
    order: list[int] = []
    begins: list[bool] = []
    swapped = doubled = gaps = 0
    for part in np.split(np.arange(len(time_s)), restarts):
        ranks = np.argsort(time_s[part], kind="stable")
        swapped += int(np.sum(np.diff(time_s[part]) < 0))
        kept = part[ranks]
        fresh = np.concatenate(([True], np.diff(time_s[kept]) > 1e-3 * period_s))
        doubled += int(np.sum(~fresh))
        kept = kept[fresh]
        gap = _gaps(np.diff(time_s[kept]), period_s)
        gaps += int(gap.sum())
        order.extend(kept.tolist())
        begins.extend([True, *gap.tolist()])
    if swapped:
        notes.append(f"{swapped} rows were out of order: sorted by time")
    if doubled:
        notes.append(f"{doubled} rows repeat a time: left out")
    if gaps:
        notes.append(f"{gaps} gaps in time: the motor's state is found anew after each")
    if len(restarts):
        notes.append(f"the time starts again {len(restarts)} times: read as {len(restarts) + 1} runs")
    return np.array(order, dtype=np.intp), np.array(begins, dtype=bool), notes


def _gaps(steps: FloatArray, period_s: float) -> BoolArray:
    low, high = np.percentile(steps, (10, 90)) if len(steps) else (1.0, 1.0)
    factor = GAP_REGULAR if high < REGULAR_SPREAD * low else GAP_IRREGULAR
    result: BoolArray = steps > factor * period_s
    return result
