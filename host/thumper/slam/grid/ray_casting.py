"""The cells that the beams of a scan cross, each of them once."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.lidar.deskew import INVALID, KindArray

LayerArray = NDArray[np.uint8]
CrossedArray = NDArray[np.int32]


class GridBeams(NamedTuple):
    """A scan in cells: integer parts are (column, row)."""

    origins: FloatArray  # shape (n, 2)
    ends: FloatArray  # shape (n, 2)
    kinds: KindArray  # HIT, MISS or INVALID, shape (n,)


@kernel
def cast_rays(beams: GridBeams, start: int, every: int, mark: int, layer: LayerArray) -> CrossedArray:
    """Return (row, column) of the cells crossed, shape (cells, 2), without the cells of the beams' ends.

    Only one beam in `every` is cast, from number `start` on. Cells that carry `mark` in the layer are
    skipped; all others get it. Traversal: Amanatides and Woo, "A fast voxel traversal algorithm for ray
    tracing", Eurographics 1987.
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
        for _ in range(abs(end_row - row) + abs(end_col - col)):
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
