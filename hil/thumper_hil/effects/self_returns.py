"""Self-returns: a loose cable beside the lidar shows in some scans, in a few beams."""

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_hil.effects.body_parts import body_parts

CABLE = body_parts().cable


def add_self_returns(
    ranges_m: FloatArray, bearings_rad: FloatArray, share: float, rng: np.random.Generator
) -> FloatArray:
    """Return the ranges of one revolution or a part of it, shape (n,), with the cable in `share` of them."""
    if share == 0.0 or rng.random() >= share:
        return ranges_m
    off_deg = np.abs(np.remainder(np.degrees(bearings_rad) - CABLE.bearing_deg + 180.0, 360.0) - 180.0)
    return np.where(off_deg < 0.5 * CABLE.width_deg, np.minimum(ranges_m, CABLE.range_m), ranges_m)
