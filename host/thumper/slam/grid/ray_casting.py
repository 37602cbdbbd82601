"""The cells that the beams of a scan cross, each of them once."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.lidar.deskew import INVALID, KindArray
from thumper.maps.cell_changes import CellBox

LayerArray = NDArray[np.uint8]
CrossedArray = NDArray[np.int32]


class GridBeams(NamedTuple):
    """A scan in cells: integer parts are (column, row)."""

    origins: FloatArray  # shape (n, 2)
    ends: FloatArray  # shape (n, 2)
    kinds: KindArray  # HIT, MISS or INVALID, shape (n,)


@kernel
def valid_beams(
    origins_m: FloatArray, ends_m: FloatArray, kinds: KindArray, pose: FloatArray, cell_m: float
) -> tuple[GridBeams, CellBox]:
    """Return the valid beams in metres in the map, and the box round the cells where they begin and end.

    `pose`, shape (3,), is the robot's. Cells are counted from the map's origin. The box is empty without a
    valid beam.
    """
    valid = np.flatnonzero(kinds != INVALID)
    beams = GridBeams(_moved(origins_m, valid, pose), _moved(ends_m, valid, pose), kinds[valid])
    if not valid.size:
        return beams, CellBox(0, 0, 0, 0)
    left = top = math.inf
    right = bottom = -math.inf
    for i in range(valid.size):
        for points_m in (beams.origins, beams.ends):
            left, right = min(left, points_m[i, 0]), max(right, points_m[i, 0])
            top, bottom = min(top, points_m[i, 1]), max(bottom, points_m[i, 1])
    first = math.floor(top / cell_m), math.floor(left / cell_m)
    return beams, CellBox(*first, math.floor(bottom / cell_m) + 1, math.floor(right / cell_m) + 1)


@kernel
def _moved(points_m: FloatArray, chosen: NDArray[np.int64], pose: FloatArray) -> FloatArray:
    """Return the chosen points, shape (n, 2), seen from the robot at the pose, in the map."""
    moved_m = np.empty((chosen.size, 2))
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for i in range(chosen.size):
        x_m, y_m = points_m[chosen[i], 0], points_m[chosen[i], 1]
        moved_m[i, 0] = pose[0] + cos * x_m - sin * y_m
        moved_m[i, 1] = pose[1] + sin * x_m + cos * y_m
    return moved_m


@kernel
def cast_rays(
    beams: GridBeams, start: int, every: int, mark: int, layer: LayerArray, first: tuple[int, int]
) -> CrossedArray:
    """Return (row, column) of the cells crossed, shape (cells, 2), without the cells of the beams' ends.

    Only one beam in `every` is cast, from number `start` on. Cells that carry `mark` in the layer are
    skipped; all others get it. The layer begins at the cell `first`, (row, column), and rows and columns are
    counted from there.

    Traversal: Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing", Eurographics 1987.
    """
    origins, ends, kinds = beams.origins, beams.ends, beams.kinds
    room = 0
    for i in range(start, kinds.size, every):
        room += int(abs(ends[i, 0] - origins[i, 0]) + abs(ends[i, 1] - origins[i, 1])) + 3
    crossed, n = np.empty((room, 2), dtype=np.int32), 0
    for i in range(start, kinds.size, every):
        if kinds[i] == INVALID:
            continue
        row, col = math.floor(origins[i, 1]), math.floor(origins[i, 0])
        end_row, end_col = math.floor(ends[i, 1]), math.floor(ends[i, 0])
        dx, dy = ends[i, 0] - origins[i, 0], ends[i, 1] - origins[i, 1]
        step_col, step_row = (1 if dx > 0.0 else -1), (1 if dy > 0.0 else -1)
        # Fraction of the beam at which it enters the next column or row, and between two such crossings.
        next_x = ((col + (dx > 0.0)) - origins[i, 0]) / dx if dx != 0.0 else math.inf
        next_y = ((row + (dy > 0.0)) - origins[i, 1]) / dy if dy != 0.0 else math.inf
        every_x = abs(1.0 / dx) if dx != 0.0 else math.inf
        every_y = abs(1.0 / dy) if dy != 0.0 else math.inf
        steps = abs(end_row - row) + abs(end_col - col)
        row, col = row - first[0], col - first[1]
        for _ in range(steps):
            if layer[row, col] != mark:
                layer[row, col] = mark
                crossed[n, 0], crossed[n, 1] = row, col
                n += 1
            if next_x < next_y:
                next_x += every_x
                col += step_col
            else:
                next_y += every_y
                row += step_row
    return crossed[:n]
