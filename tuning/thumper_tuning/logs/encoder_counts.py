"""Counts as they come from encoders: wrapped, reset, or given per row. Pure."""

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.logs.sampling import IntArray

WIDTHS = (8, 16, 24, 32)
FILLED = 0.9  # a wrapped counter comes this near to both of its ends


def unwrap(counts: FloatArray) -> tuple[FloatArray, int]:
    """Undo the wrap of a counter of 8, 16, 24 or 32 bits, signed or not; NaN stays NaN.

    Returns
    -------
    tuple
        The counts without jumps, and the counter's bits, 0 if it never wrapped.
    """
    known = np.flatnonzero(np.isfinite(counts))
    if len(known) < 3:
        return counts, 0
    values = counts[known]
    steps = np.diff(values)
    usual = 20.0 * (np.median(np.abs(steps)) + 1.0)
    for bits in WIDTHS:
        span = 2.0**bits
        inside = (values.min() >= 0 and values.max() < span) or (
            values.min() >= -span / 2 and values.max() < span / 2
        )
        jumps = np.abs(steps) > span / 2
        if not inside or not jumps.any() or np.ptp(values) < FILLED * span:
            continue
        wrapped = (steps + span / 2) % span - span / 2
        # A wrap leaves an ordinary step behind; a glitch or a reset does not.
        if np.median(np.abs(wrapped[jumps])) <= max(usual, span / 16):
            result = counts.copy()
            result[known] = values[0] + np.concatenate(([0.0], np.cumsum(np.where(jumps, wrapped, steps))))
            return result, bits
    return counts, 0


def resets(counts: FloatArray) -> IntArray:
    """Return the rows (indices) at which the counter starts again from zero."""
    known = np.flatnonzero(np.isfinite(counts))
    values = counts[known]
    steps = np.abs(np.diff(values))
    usual = np.percentile(steps, 95) if len(steps) else 0.0
    at = (np.abs(values[1:]) <= usual) & (steps > 20.0 * (usual + 1.0))
    # What returns at once was a spike, not a reset.
    stays = np.ones(len(at), dtype=bool)
    stays[:-1] = steps[1:] <= 2.0 * (usual + 1.0)
    rows: IntArray = known[1:][at & stays]
    return rows


def look_like_counts_per_row(counts: FloatArray, drive: FloatArray) -> bool:
    """Whether the numbers follow the drive as a speed does, and not as a position."""
    known = np.isfinite(counts) & np.isfinite(drive)
    y, u = counts[known], drive[known]
    if len(y) < 10 or np.ptp(y) == 0.0 or np.ptp(u) == 0.0:
        return False
    as_speed = _explained(y[1:], u[:-1])
    as_position = _explained(np.diff(y), u[:-1])
    return as_speed > 0.6 and as_speed > as_position + 0.1


def _explained(y: FloatArray, u: FloatArray) -> float:
    """R^2 of y on the last two inputs and their sign."""
    before = np.concatenate(([u[0]], u[:-1]))
    X = np.column_stack((u, before, np.sign(u), np.ones_like(u)))
    residual = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    return float(1.0 - residual.var() / max(y.var(), 1e-12))
