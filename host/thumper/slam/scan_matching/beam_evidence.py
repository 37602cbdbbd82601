"""What the beams of a scan say about one pose in a map."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel, member
from thumper.slam.scan_matching.distance_field import (
    MetricField,
    distance_at,
    field_shape,
    is_known,
)
from thumper.slam.scan_matching.patch_grid import PatchGrid

# This close before its end, a beam may pass a cell that is a wall in the map: neither is exact.
WALL_MARGIN_M = 0.3
NEW_AREA_BELOW = 0.2  # share of the beams


class KnownCells(NamedTuple):
    """Which cells beams have crossed."""

    mask: NDArray[np.bool_]  # shape (rows, columns)


@member(is_known, KnownCells)
def _is_in_mask(known: KnownCells, row: int, col: int) -> bool:
    return known.mask[row, col]  # type: ignore[no-any-return]


class BeamEvidence(NamedTuple):
    """What the beams of a scan say about one pose."""

    # Of each beam, shape (n,): the likelihood that it ends on a wall, 0...1; 0 if it passes through another.
    supports: FloatArray
    # Share of beams that end on a wall, 0...1. One that ends in unknown space does not count, but at least
    # half of the beams count.
    explained: float
    # Share of beams that support the pose minus the share against it, -1...1. A beam that passes through a
    # wall counts against the pose, whatever it ends on.
    fit: float
    # Share of beams that end in free space, or pass through a wall, 0...1. It is near zero for a look through
    # a door into a new room, and large for a kidnapped robot.
    contradicting_share: float

    @property
    def shows_new_area(self) -> bool:
        """Whether hardly a beam contradicts the map: what the map does not explain is new."""
        return self.contradicting_share < NEW_AREA_BELOW


@kernel
def beam_evidence(
    origins_m: FloatArray,
    ends_m: FloatArray,
    pose: FloatArray,
    field: MetricField,
    known: KnownCells | PatchGrid,
    std_m: float,
) -> BeamEvidence:
    """Return the evidence of beams with ends of shape (n, 2) at a pose, shape (3,), from the map's corner.

    `known` shows where beams have crossed the map (`is_known`).
    """
    (rows, cols), cells_per_m = field_shape(field), 1.0 / field.resolution_m
    n = ends_m.shape[0]
    supports = np.empty(n)
    on_walls, through, unknown, against = 0.0, 0, 0, 0
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for i in range(n):
        from_col = (pose[0] + cos * origins_m[i, 0] - sin * origins_m[i, 1]) * cells_per_m
        from_row = (pose[1] + sin * origins_m[i, 0] + cos * origins_m[i, 1]) * cells_per_m
        to_col = (pose[0] + cos * ends_m[i, 0] - sin * ends_m[i, 1]) * cells_per_m
        to_row = (pose[1] + sin * ends_m[i, 0] + cos * ends_m[i, 1]) * cells_per_m
        passes = _passes_wall(from_col, from_row, to_col, to_row, field, cells_per_m)
        row, col = math.floor(to_row), math.floor(to_col)
        inside = 0 <= row < rows and 0 <= col < cols
        near = inside and distance_at(field, row, col) <= WALL_MARGIN_M
        likelihood = math.exp(-0.5 * (distance_at(field, row, col) / std_m) ** 2) if near else 0.0
        # A beam that crosses no wall, and ends away from walls in unknown space, says nothing.
        is_unknown = not (passes or near or (inside and is_known(known, row, col)))
        supports[i] = 0.0 if passes else likelihood
        on_walls += likelihood
        through += passes
        unknown += is_unknown
        against += passes or (likelihood == 0.0 and not is_unknown)
    counted = max(1.0, 0.5 * n, float(n - unknown))
    return BeamEvidence(supports, on_walls / counted, (on_walls - through) / counted, against / max(1, n))


@kernel
def _passes_wall(
    from_col: float, from_row: float, to_col: float, to_row: float, field: MetricField, cells_per_m: float
) -> bool:
    """Return whether a beam crosses an occupied cell more than `WALL_MARGIN_M` before its end."""
    rows, cols = field_shape(field)
    length = math.hypot(to_col - from_col, to_row - from_row)
    step_col, step_row = (to_col - from_col) / max(1.0, length), (to_row - from_row) / max(1.0, length)
    k, steps = 0, int(length - WALL_MARGIN_M * cells_per_m)
    while k < steps:
        row, col = math.floor(from_row + k * step_row), math.floor(from_col + k * step_col)
        k += 1
        if 0 <= row < rows and 0 <= col < cols:
            if distance_at(field, row, col) == 0.0:
                return True
            # After j steps the beam is in a cell at most j + sqrt(2) cells away, centre to centre. So it need
            # not look before the nearest wall (Hart, "Sphere tracing", The Visual Computer 12, 1996).
            k += max(0, int(distance_at(field, row, col) * cells_per_m - 1.5))
    return False
