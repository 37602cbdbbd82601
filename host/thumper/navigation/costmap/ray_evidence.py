"""What one scan says about places: seen, hidden, passed by rays, or silent. Pure.

A beam without an echo says nothing by itself: the space may be open, or the surface dark, shiny or at a
grazing angle.
"""

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.numba_kernel import kernel
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


HIDDEN, SEEN = int(Evidence.HIDDEN), int(Evidence.SEEN)  # a compiled kernel takes plain numbers
PASSED, SILENT = int(Evidence.PASSED), int(Evidence.SILENT)
NO_GAPS = (np.empty(0), 0.0)  # all directions are silent


class ScanRays:
    """The rays of one scan, taken at `map_from_base`. `hits_m`, shape (k, 2) in map [m], are its echoes."""

    def __init__(self, view: FieldOfView, map_from_base: Pose2, hits_m: FloatArray) -> None:
        self._view, self._map_from_base = view, map_from_base
        hit_rad, hit_m = view.bearings_and_ranges(map_from_base, hits_m)
        self._nearest_m, self._gaps = _nearest_echoes_m(hit_rad, hit_m), _gaps(hit_rad)

    def evidence(self, points_m: FloatArray, depth_m: float) -> NDArray[np.int64]:
        """Return the `Evidence` about each place, shape (n,); the places have shape (n, 2), in map [m].

        An echo within `depth_m` of a place comes from it.
        """
        bearing_rad, range_m = self._view.bearings_and_ranges(self._map_from_base, points_m)
        found = _evidence(bearing_rad, range_m, self._nearest_m, *self._gaps, depth_m)
        found[~self._view.contains(bearing_rad, range_m, edge_rad=BIN_RAD)] = Evidence.OUT_OF_VIEW
        return found


class Look:
    """What one scan had a free view of, compact enough to be remembered."""

    def __init__(self, view: FieldOfView, map_from_base: Pose2, hits_m: FloatArray) -> None:
        """`hits_m`, shape (k, 2), are the echoes in map [m] of a scan taken at `map_from_base`."""
        self._view, self._map_from_base = view, map_from_base
        self._echoes_m = _nearest_echoes_m(*view.bearings_and_ranges(map_from_base, hits_m))

    def distance_m(self, other: "Look") -> float:
        """Return how far the lidar was from where it was in another look [m]."""
        mount = self._view.base_from_laser
        return (self._map_from_base @ mount).distance_m(other._map_from_base @ mount)

    def is_open(self, points_m: FloatArray) -> NDArray[np.bool_]:
        """Return which places, shape (n, 2) in map [m], were in view, with no echo from there or nearer."""
        bearing_rad, range_m = self._view.bearings_and_ranges(self._map_from_base, points_m)
        in_view = self._view.contains(bearing_rad, range_m, edge_rad=BIN_RAD)
        evidence = _evidence(bearing_rad, range_m, self._echoes_m, *NO_GAPS, 0.0)
        return np.asarray(in_view & (evidence == Evidence.SILENT))


def _gaps(hit_rad: FloatArray) -> tuple[FloatArray, float]:
    """Return the directions of the echoes in order, and the widest gap that holds no silent beam [rad]."""
    if hit_rad.size < 2:
        return NO_GAPS
    ordered = np.sort(hit_rad)
    ordered = np.concatenate((ordered[-1:] - math.tau, ordered, ordered[:1] + math.tau))
    return ordered, min(MAX_GAP_RAD, GAP_BEAMS * _median(ordered[1:] - ordered[:-1]))


def _median(values: FloatArray) -> float:
    """Return what `np.median` does, shape (n,), in a fifth of its time."""
    low, high = (values.size - 1) // 2, values.size // 2
    ordered = np.partition(values, (low, high))
    return 0.5 * float(ordered[low] + ordered[high])


@kernel
def _bin(bearing_rad: float) -> int:
    return int((bearing_rad + math.pi) / BIN_RAD) % BINS


@kernel
def _nearest_echoes_m(hit_rad: FloatArray, hit_m: FloatArray) -> FloatArray:
    """Return the range of the nearest echo in and beside each bin, shape (BINS,); inf without one."""
    nearest_m = np.full(BINS, np.inf)
    for k in range(len(hit_rad)):
        centre = _bin(hit_rad[k])
        for index in (centre - 1, centre, centre + 1):
            nearest_m[index % BINS] = min(nearest_m[index % BINS], hit_m[k])
    return nearest_m


@kernel
def _evidence(
    bearing_rad: FloatArray,
    range_m: FloatArray,
    nearest_m: FloatArray,
    ordered_rad: FloatArray,
    gap_rad: float,
    depth_m: float,
) -> NDArray[np.int64]:
    """Return the evidence about each place, shape (n,), as if all were in view.

    `ordered_rad` are the echoes' directions in order; a wider gap than `gap_rad` holds a silent beam.
    """
    found = np.empty(len(bearing_rad), np.int64)
    for k in range(len(bearing_rad)):
        there_m = nearest_m[_bin(bearing_rad[k])]
        if there_m < range_m[k] - depth_m:
            found[k] = HIDDEN
        elif there_m <= range_m[k] + depth_m:
            found[k] = SEEN
        else:
            after = min(max(np.searchsorted(ordered_rad, bearing_rad[k]), 1), len(ordered_rad) - 1)
            is_between = len(ordered_rad) > 0 and ordered_rad[after] - ordered_rad[after - 1] <= gap_rad
            found[k] = PASSED if is_between else SILENT
    return found
