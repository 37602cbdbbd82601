"""Distance to the nearest occupied cell, updated exactly as cells become occupied and free.

The score of a beam is then one table look-up, and an update costs only where a cell has changed. The idea is
that of Lau, Sprunk, Burgard, "Improved updating of Euclidean distance maps and Voronoi diagrams", IROS 2010.
Here the distance is bounded, so a plain window replaces their wave front.

Distances are measured between cell centres and cut off at the largest distance. Both mappers keep them in
patches (`patches.py`): `GridMapper` as squares, which are exact, and the particle filter quantized. Both
update them block by block with the kernels below. A finished map has them in metres, in one array.
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from thumper.common.numba_kernel import kernel, member

FieldArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]
CountArray = NDArray[np.uint8]
# Distances [m], quantized ones, or squares in cells; 0 on an occupied cell.
LevelArray = FieldArray | ByteArray | NDArray[np.uint16]


class MetricField(Protocol):
    """A distance field to match against: `distance_at` and `field_shape` have a member for its kind."""

    @property
    def resolution_m(self) -> float:
        """Side of a cell."""
        ...

    @property
    def max_distance_m(self) -> float:
        """Cut-off: cells at this distance have nothing near them."""
        ...


class DistanceField(NamedTuple):
    """A distance field in one array. Numba passes a named tuple of arrays as it is."""

    distance_m: FieldArray  # shape (rows, columns)
    resolution_m: float
    max_distance_m: float


def distance_at(field: object, row: int, col: int) -> float:
    """Return the distance at a cell of the field [m]. A generic function of kernels, as are the two below."""
    raise NotImplementedError


def is_known(known: object, row: int, col: int) -> bool:
    """Return whether a beam has crossed the cell."""
    raise NotImplementedError


def field_shape(field: object) -> tuple[int, int]:
    """Return the number of rows and columns."""
    raise NotImplementedError


@member(distance_at, DistanceField)
def _distance_in_array(field: DistanceField, row: int, col: int) -> float:
    return field.distance_m[row, col]  # type: ignore[no-any-return]


@member(field_shape, DistanceField)
def _shape_of_array(field: DistanceField) -> tuple[int, int]:
    return field.distance_m.shape


class InsertionRule(NamedTuple):
    """How counts become occupied cells, and occupied cells become distances."""

    stencil: LevelArray  # distances around an occupied cell, shape (2 n + 1, 2 n + 1)
    levels: LevelArray  # distance by squared distance in cells, shape (2 n^2 + 1,); the last is the cut-off
    max_distance_cells: int  # n
    occupied_fraction: float  # share of hits that makes a cell occupied
    release: float  # part of that share below which an occupied cell becomes free


class LostCells(NamedTuple):
    """Cells whose distance was to an obstacle that is gone; float32, so that the compiler vectorizes."""

    rows: FieldArray
    cols: FieldArray
    squared: FieldArray  # distance to the nearest other obstacle found so far, in cells, squared


def insertion_rule(
    levels: LevelArray, max_distance_cells: int, occupied_fraction: float, release: float = 1.0
) -> InsertionRule:
    """Return the rule for distances given by squared distance in cells, shape (2 n^2 + 1,)."""
    squared = np.arange(-max_distance_cells, max_distance_cells + 1) ** 2
    stencil = levels[squared[:, np.newaxis] + squared]
    return InsertionRule(stencil, levels, max_distance_cells, occupied_fraction, release)


def metric_distances(max_distance_cells: int, resolution_m: float) -> FieldArray:
    """Return the table from squared distance in cells to distance [m], cut off at the largest distance."""
    squared = np.arange(2 * max_distance_cells * max_distance_cells + 1)
    exact_m = np.minimum(resolution_m * np.sqrt(squared), max_distance_cells * resolution_m)
    return exact_m.astype(np.float32)


@kernel
def is_occupied(hits: int, misses: int, occupied_fraction: float) -> bool:
    """Return whether enough of the beams that reached the cell ended in it."""
    return hits > 0 and hits >= occupied_fraction * (hits + misses)


@kernel
def lost_cells(max_distance_cells: int) -> LostCells:
    """Return an empty list with room for all cells near an obstacle."""
    side = 2 * max_distance_cells + 1
    return LostCells(
        np.empty(side * side, dtype=np.float32),
        np.empty(side * side, dtype=np.float32),
        np.full(side * side, max_distance_cells * max_distance_cells, dtype=np.float32),
    )


@kernel
def lower_to_stencil(near: LevelArray, around: LevelArray) -> None:
    """Lower a block of distances to those from one obstacle, which begin at `around[0, 0]`."""
    for r in range(near.shape[0]):  # without branches, so the compiler vectorizes it
        for c in range(near.shape[1]):
            level, old = around[r, c], near[r, c]
            near[r, c] = level if level < old else old


@kernel
def list_lost_cells(
    near: LevelArray, around: LevelArray, far: float, corner: tuple[int, int], lost: LostCells, n: int
) -> int:
    """Add the cells of a block whose distance may be to the removed obstacle; return their new number.

    `around` are the distances from the obstacle. `corner` is the row and column of the block's first cell.
    """
    for r in range(near.shape[0]):
        for c in range(near.shape[1]):
            if around[r, c] != far and near[r, c] == around[r, c]:
                lost.rows[n], lost.cols[n] = corner[0] + r, corner[1] + c
                n += 1
    return n


@kernel
def search_box(lost: LostCells, max_distance_cells: int) -> tuple[int, int, int, int]:
    """Return first and last row, first and last column, of the obstacles that may be near the lost cells."""
    return (
        int(lost.rows.min()) - max_distance_cells,
        int(lost.rows.max()) + max_distance_cells,
        int(lost.cols.min()) - max_distance_cells,
        int(lost.cols.max()) + max_distance_cells,
    )


@kernel
def lower_to_obstacles(block: LevelArray, corner: tuple[int, int], lost: LostCells) -> None:
    """Lower the squared distances of the lost cells to those from all obstacles in a block.

    A cell is occupied exactly where its distance is 0.
    """
    for r in range(block.shape[0]):
        occupied = 0
        for c in range(block.shape[1]):  # without branches: most rows hold no obstacle
            occupied += block[r, c] == 0
        if occupied:
            for c in range(block.shape[1]):
                if block[r, c] == 0:
                    _lower_to_obstacle(corner[0] + r, corner[1] + c, lost)


@kernel
def _lower_to_obstacle(row: int, col: int, lost: LostCells) -> None:
    obstacle_row, obstacle_col = np.float32(row), np.float32(col)
    for i in range(lost.rows.size):
        dr, dc = lost.rows[i] - obstacle_row, lost.cols[i] - obstacle_col
        found, old = dr * dr + dc * dc, lost.squared[i]
        lost.squared[i] = found if found < old else old
