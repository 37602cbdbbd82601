"""Repair encoder counts: counter wraps, counter resets, counts per row. Pure functions."""

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.logs.sampling import IntArray
from thumper_tuning.logs.units import log_error

COUNTER_BITS = (8, 16, 24, 32)
TURN_MARGIN = 0.1  # a wrapped angle comes this near to both ends of its turn
MAX_TURNS_PER_ROW = 0.42
MIN_RANGE_USED = 0.9  # a counter that wraps uses at least this share of its range


def unwrap(counts: FloatArray) -> tuple[FloatArray, int]:
    """Undo the wraps of a signed or unsigned counter of 8, 16, 24 or 32 bits; NaN stays NaN.

    Returns
    -------
    tuple
        The counts without jumps, and the counter's bits (0: it never wraps).
    """
    known = np.flatnonzero(np.isfinite(counts))
    if len(known) < 3:
        return counts, 0
    values = counts[known]
    steps = np.diff(values)
    usual = 20.0 * (np.median(np.abs(steps)) + 1.0)
    for bits in COUNTER_BITS:
        span = 2.0**bits
        in_range = (values.min() >= 0 and values.max() < span) or (
            values.min() >= -span / 2 and values.max() < span / 2
        )
        jumps = np.abs(steps) > span / 2
        if not in_range or not jumps.any() or np.ptp(values) < MIN_RANGE_USED * span:
            continue
        wrapped = (steps + span / 2) % span - span / 2
        # A wrap leaves an ordinary step behind; a glitch or a reset does not.
        if np.median(np.abs(wrapped[jumps])) <= max(usual, span / 16):
            result = counts.copy()
            result[known] = values[0] + np.concatenate(([0.0], np.cumsum(np.where(jumps, wrapped, steps))))
            return result, bits
    return counts, 0


def unwrap_turns(turns: FloatArray) -> tuple[FloatArray, bool]:
    """Undo the wraps of an angle that stays within one turn, from 0 or from -1/2; NaN stays NaN.

    Returns
    -------
    tuple
        The angle without jumps [turns], and whether it wraps.

    Raises
    ------
    ThumperError
        It turns by nearly half a turn per row: its direction is not known.
    """
    known = np.flatnonzero(np.isfinite(turns))
    values = turns[known]
    low, high = float(values.min(initial=np.inf)), float(values.max(initial=-np.inf))
    steps = np.diff(values)
    jumps = np.abs(steps) > 0.5
    within = (
        min(abs(low), abs(low + 0.5)) < TURN_MARGIN and high <= round(2.0 * low) / 2.0 + 1.0 + TURN_MARGIN
    )
    if not within or not jumps.any() or high - low < MIN_RANGE_USED:
        return turns, False
    wrapped = (steps + 0.5) % 1.0 - 0.5
    if float(np.percentile(np.abs(wrapped), 99)) > MAX_TURNS_PER_ROW:
        raise log_error(
            "the angle wraps each turn and moves by nearly half a turn per row: log it faster, or log counts"
        )
    result = turns.copy()
    result[known] = values[0] + np.concatenate(([0.0], np.cumsum(wrapped)))
    return result, True


def find_resets(counts: FloatArray) -> IntArray:
    """Return the rows (indices) at which the counter restarts from zero."""
    known = np.flatnonzero(np.isfinite(counts))
    values = counts[known]
    steps = np.abs(np.diff(values))
    usual = np.percentile(steps, 95) if len(steps) else 0.0
    at = (np.abs(values[1:]) <= usual) & (steps > 20.0 * (usual + 1.0))
    # A value that jumps back in the next row was a spike, not a reset.
    stays = np.ones(len(at), dtype=bool)
    stays[:-1] = steps[1:] <= 2.0 * (usual + 1.0)
    rows: IntArray = known[1:][at & stays]
    return rows


def look_like_counts_per_row(counts: FloatArray, drive: FloatArray) -> bool:
    """Return whether the numbers follow the drive as a speed does, not as a position does."""
    known = np.isfinite(counts) & np.isfinite(drive)
    y, u = counts[known], drive[known]
    if len(y) < 10 or np.ptp(y) == 0.0 or np.ptp(u) == 0.0:
        return False
    as_speed = _r_squared(y[1:], u[:-1])
    as_position = _r_squared(np.diff(y), u[:-1])
    return as_speed > 0.6 and as_speed > as_position + 0.1


def _r_squared(y: FloatArray, u: FloatArray) -> float:
    """R^2 of a regression of y on the last two inputs and the sign of the last."""
    previous = np.concatenate(([u[0]], u[:-1]))
    X = np.column_stack((u, previous, np.sign(u), np.ones_like(u)))
    residual = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    return float(1.0 - residual.var() / max(y.var(), 1e-12))
