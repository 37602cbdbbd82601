"""Detect logs whose rows hold the drive of the interval before them, and shift it. Pure functions."""

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.logs.motor_log import BoolArray

REST_ROWS = 3  # without drive and motion before a start
WARNING = (
    "the speed starts in the same row as the drive: each row's drive is taken as applied since the row before"
)


def acts_before_its_row(drive: FloatArray, motion: FloatArray, starts_segment: BoolArray) -> bool:
    """Return whether most starts from rest show motion in the row in which the drive begins.

    A loop that writes the PWM, waits, measures and then logs makes such rows. `motion[k]` is the speed or the
    counts of the interval that ends at row k.
    """
    idle = (drive == 0.0) & (np.nan_to_num(motion) == 0.0)
    early = late = 0
    for k in range(REST_ROWS, len(drive)):
        rested = idle[k - REST_ROWS : k].all() and not starts_segment[k - REST_ROWS + 1 : k + 1].any()
        if rested and drive[k] != 0.0 and np.isfinite(motion[k]):
            early, late = early + (motion[k] != 0.0), late + (motion[k] == 0.0)
    return early > late


def shifted(drive: FloatArray, starts_segment: BoolArray) -> FloatArray:
    """Return the drive from each row on, if a row holds the drive before it; the last rows keep theirs."""
    result = drive.copy()
    inside = ~starts_segment[1:]
    result[:-1][inside] = drive[1:][inside]
    return result
