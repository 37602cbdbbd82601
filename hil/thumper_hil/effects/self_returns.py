"""Self-returns: a loose cable beside the lidar shows in some scans, in a few beams."""

import math

import numpy as np

from thumper.common.geometry import FloatArray

CABLE_BEARING_RAD = math.radians(105.0)  # left and behind the lidar, inside the footprint
CABLE_WIDTH_RAD = math.radians(4.0)
CABLE_RANGE_M = 0.09


def add_self_returns(
    ranges_m: FloatArray, bearings_rad: FloatArray, share: float, rng: np.random.Generator
) -> FloatArray:
    """Return the ranges of one revolution or a part of it, shape (n,), with the cable in `share` of them."""
    if share == 0.0 or rng.random() >= share:
        return ranges_m
    off_rad = np.abs(np.remainder(bearings_rad - CABLE_BEARING_RAD + math.pi, math.tau) - math.pi)
    return np.where(off_rad < 0.5 * CABLE_WIDTH_RAD, np.minimum(ranges_m, CABLE_RANGE_M), ranges_m)
