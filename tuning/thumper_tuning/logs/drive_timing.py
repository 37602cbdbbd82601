"""Detect logs whose rows hold the drive of the interval before them, and shift it. Pure functions."""

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.logs.motor_log import BoolArray

STILL_ROWS = 3  # without drive and motion before a start
NOISE_ROWS = 6  # without drive, if noise hides that the wheel is still
ROUNDING = 1e-9  # of the largest speed
MOTION_SIGMAS = 4.0  # of the noise
MEDIAN_STD = (0.5 * np.pi) ** 0.5  # of the median of many normal values, in standard deviations of their mean
WARNING = (
    "the speed starts in the same row as the drive: each row's drive is taken as applied since the row before"
)


def acts_before_its_row(drive: FloatArray, motion: FloatArray, starts_segment: BoolArray) -> bool:
    """Return whether the wheel already turns in the row in which the drive begins, at most starts from rest.

    A loop that writes the PWM, waits, measures and then logs makes such rows. `motion[k]` is the speed or the
    counts of the interval that ends at row k.
    """
    largest = float(np.nanmax(np.abs(motion), initial=0.0))
    motion = np.where(np.abs(motion) < ROUNDING * largest, 0.0, motion)  # of speeds computed from counts
    first, variance = [], []
    segment = np.cumsum(starts_segment)
    begins = np.flatnonzero((drive[1:] != 0.0) & (drive[:-1] == 0.0)) + 1
    for k in begins[np.isfinite(motion[begins])].tolist():
        before = slice(max(k - NOISE_ROWS, 0), k)
        off = (drive[before] == 0.0) & (segment[before] == segment[k])
        noise = _noise_at_rest(motion[before], off)
        if noise is not None:
            first.append(np.sign(drive[k]) * motion[k])
            variance.append(noise**2)
    if not first:
        return False
    median_std = MEDIAN_STD * np.sqrt(np.mean(variance) / len(first))
    return bool(np.percentile(first, 50.0, method="lower") > MOTION_SIGMAS * median_std)


def _noise_at_rest(motion: FloatArray, off: BoolArray) -> float | None:
    """Return the std of the motion before a start; None if the wheel turns, or of too few rows."""
    if len(off) >= STILL_ROWS and off[-STILL_ROWS:].all() and not np.nan_to_num(motion[-STILL_ROWS:]).any():
        return 0.0
    std = float(np.std(motion))
    return std if len(off) == NOISE_ROWS and off.all() and abs(float(np.mean(motion))) <= std else None


def shifted(drive: FloatArray, starts_segment: BoolArray) -> FloatArray:
    """Return the drive from each row on, if a row holds the drive before it; the last rows keep theirs."""
    result = drive.copy()
    inside = ~starts_segment[1:]
    result[:-1][inside] = drive[1:][inside]
    return result
