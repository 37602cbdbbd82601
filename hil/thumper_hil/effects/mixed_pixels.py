"""Mixed pixels: a beam is wide, and at the edge of an object it measures between front and background."""

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray

JUMP_M = 0.15


def jumps_in_depth(ranges_m: FloatArray) -> NDArray[np.bool_]:
    """Return True for each beam whose next neighbour is more than 0.15 m nearer or farther, shape (n,)."""
    bounded = np.where(np.isfinite(ranges_m), ranges_m, 1e3)
    return np.asarray(np.abs(np.diff(bounded, append=bounded[-1])) > JUMP_M, np.bool_)


def mix_at_edges(
    ranges_m: FloatArray, range_max_m: float, share: float, rng: np.random.Generator
) -> FloatArray:
    """Return the ranges, shape (n,), with `share` of the beams at an edge moved between both surfaces.

    Both surfaces must be within range. Draws 2 n random values.
    """
    following = np.append(ranges_m[1:], ranges_m[-1])
    chosen = jumps_in_depth(ranges_m) & (rng.random(ranges_m.size) < share)
    part = rng.random(ranges_m.size)
    mixed = chosen & (np.maximum(ranges_m, following) <= range_max_m)
    result = ranges_m.copy()
    result[mixed] += part[mixed] * (following[mixed] - ranges_m[mixed])
    return result
