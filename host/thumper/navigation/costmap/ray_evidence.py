"""What one scan says about places: seen, hidden, passed by rays, or silent. Pure.

A beam without an echo says nothing by itself: the space may be open, or the surface dark, shiny or at a
grazing angle.
"""

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.field_of_view import FieldOfView

BIN_RAD = math.radians(1.0)
BINS = round(math.tau / BIN_RAD)
GAP_BEAMS, MAX_GAP_RAD = 1.6, math.radians(2.5)  # a wider gap between two echoes holds a silent beam


class Evidence(IntEnum):
    """What a scan says about one place."""

    OUT_OF_VIEW = 0
    HIDDEN = 1  # behind something nearer
    SEEN = 2  # an echo came from there
    PASSED = 3  # rays passed it: their echoes came from further away
    SILENT = 4  # beams went there, and no echo came back


def ray_evidence(
    view: FieldOfView, map_from_base: Pose2, hits_m: FloatArray, points_m: FloatArray, depth_m: float
) -> NDArray[np.int64]:
    """Return the `Evidence` about each place, shape (n,), from a scan taken at `map_from_base`.

    `hits_m`, shape (k, 2), are the scan's echoes and `points_m`, shape (n, 2), the places, both in map [m].
    An echo within `depth_m` of a place comes from it.
    """
    bearing_rad, range_m = view.bearings_and_ranges(map_from_base, points_m)
    hit_rad, hit_m = view.bearings_and_ranges(map_from_base, hits_m)
    nearest_m = np.full(BINS, np.inf)
    np.minimum.at(nearest_m, _bins(hit_rad), hit_m)
    around_m = np.minimum(np.minimum(np.roll(nearest_m, 1), nearest_m), np.roll(nearest_m, -1))
    there_m = around_m[_bins(bearing_rad)]
    found = np.where(_is_between_echoes(hit_rad, bearing_rad), Evidence.PASSED, Evidence.SILENT)
    found[there_m <= range_m + depth_m] = Evidence.SEEN
    found[there_m < range_m - depth_m] = Evidence.HIDDEN
    found[~view.contains(bearing_rad, range_m, edge_rad=BIN_RAD)] = Evidence.OUT_OF_VIEW
    return found


def _bins(bearing_rad: FloatArray) -> NDArray[np.int64]:
    return ((bearing_rad + math.pi) / BIN_RAD).astype(np.int64) % BINS


def _is_between_echoes(hit_rad: FloatArray, bearing_rad: FloatArray) -> NDArray[np.bool_]:
    """Return which directions, shape (n,), lie between two echoes without a silent beam between them."""
    if hit_rad.size < 2:
        return np.zeros(bearing_rad.size, np.bool_)
    ordered = np.sort(hit_rad)
    ordered = np.concatenate((ordered[-1:] - math.tau, ordered, ordered[:1] + math.tau))
    gaps = np.diff(ordered)
    limit_rad = min(MAX_GAP_RAD, GAP_BEAMS * float(np.median(gaps)))
    after = np.clip(np.searchsorted(ordered, bearing_rad), 1, ordered.size - 1)
    between: NDArray[np.bool_] = gaps[after - 1] <= limit_rad
    return between
