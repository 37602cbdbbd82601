"""Dijkstra with an interpolated potential, for navfn and the lattice heuristic. Kernels in cells.

The potential solves |grad potential| = cost: each cell takes its value from its cheaper horizontal and its
cheaper vertical neighbour, so it has no octile kinks (Sethian, "A fast marching level set method", 1996).
Two buckets replace the heap. A cell whose value falls later is expanded again (label correcting), so the
values that the search has settled do not depend on the order. Those at its edge do.
"""

import math
from typing import NamedTuple

import numpy as np

from thumper.common.numba_kernel import kernel
from thumper.common.resumable import DIJKSTRA_CELLS, Search, run_to_end
from thumper.navigation.costmap.inflation import ByteArray, IntArray
from thumper.navigation.planners.cell_costs import INFINITE, CellCosts, CostArray, cost_at, is_inside
from thumper.navigation.planners.sparse_memory import Reached, reached_from, sparse_zeros

# Width of a bucket [free cells]. Wide buckets expand cells more often, narrow ones scan the front more often.
BUCKET = 32.0
NEITHER, NOW, LATER = 0, 1, 2
HALF, TWO = np.float32(0.5), np.float32(2.0)
# The potential is 0 where the search has not been: memory that is 0 at first is only taken where it is used.
SOURCE = np.float32(1e-30)  # the least potential; too small to change a sum
LATERAL = np.float32(math.sqrt(0.5))  # a diagonal front gains at least this fraction of a cell's cost


class Wavefront(NamedTuple):
    """The state of one expansion; arrays are flat, shape (rows * cols,), but the table's (256,)."""

    costs: ByteArray
    table: CostArray
    potential: CostArray
    queued: ByteArray  # NEITHER, NOW or LATER
    rows: int
    cols: int
    guided: bool
    target_row: int
    target_col: int


@kernel
def potential_at(potential: CostArray, cell: int) -> np.float32:
    """Return the potential of a cell; inf where the search has not been."""
    value = potential[cell]
    return value if value > 0.0 else INFINITE


@kernel
def eikonal_value(wave: Wavefront, cell: int) -> np.float32:
    """Return the potential of a cell from its neighbours (upwind solution of the eikonal equation)."""
    potential, here = wave.potential, wave.table[wave.costs[cell]]
    right, left = potential_at(potential, cell + 1), potential_at(potential, cell - 1)
    up, down = potential_at(potential, cell + wave.cols), potential_at(potential, cell - wave.cols)
    across, along = min(left, right), min(up, down)
    low, high = min(across, along), max(across, along)
    gap = high - low
    if gap >= here:
        value: np.float32 = low + here
    else:
        value = HALF * (low + high + math.sqrt(TWO * here * here - gap * gap))
    return value


@kernel
def place_of(wave: Wavefront, cell: int) -> tuple[int, int]:
    """Return the row and column of a cell."""
    row = cell // wave.cols
    return row, cell - row * wave.cols


@kernel
def expansion_key(wave: Wavefront, row: int, col: int, value: np.float32) -> np.float32:
    """Return the key that decides in which bucket a cell is expanded (A*'s when guided)."""
    key = value
    if wave.guided:
        dy, dx = np.float32(row - wave.target_row), np.float32(col - wave.target_col)
        key += math.sqrt(dx * dx + dy * dy)
    return key


class Buckets(NamedTuple):
    """Cells to expand now and later, flat indices; the arrays may be replaced by larger ones."""

    now: IntArray
    later: IntArray
    reached: Reached  # box round all cells expanded so far


class BucketState(NamedTuple):
    """How far the expansion is."""

    next: int  # index in `now`
    n_now: int
    n_later: int
    limit: float  # `now` holds the cells up to here [free cells]


@kernel
def expand_bucket(
    wave: Wavefront, buckets: Buckets, progress: BucketState, budget: int
) -> tuple[Buckets, BucketState, int]:
    """Expand the cells of the bucket `now` and those they add; put cells beyond the limit in `later`.

    Stops after `budget` cells; returns what is left of it.
    """
    now, later, reached = buckets
    i, n_now, n_later, limit = progress
    bound = np.float32(limit)
    top, left, bottom, right = reached
    while i < n_now and budget > 0:
        cell = int(now[i])
        i += 1
        budget -= 1
        wave.queued[cell] = NEITHER
        value = eikonal_value(wave, cell)
        if value >= potential_at(wave.potential, cell):
            continue
        row, col = place_of(wave, cell)
        if row < top or row > bottom or col < left or col > right:
            top, left, bottom, right = min(top, row), min(left, col), max(bottom, row), max(right, col)
        if expansion_key(wave, row, col, value) >= bound:
            # The next bucket expands the cell again, when its neighbours are settled.
            if n_later == later.size:
                later = np.concatenate((later, np.empty(later.size, np.int32)))
            later[n_later] = cell
            n_later += 1
            wave.queued[cell] = LATER
            continue
        wave.potential[cell] = value
        if n_now + 4 > now.size:
            now = np.concatenate((now, np.empty(now.size, np.int32)))
        is_open = is_inside(row, col, wave.rows, wave.cols, 2)
        for k in range(4):
            neighbour = cell + (1 if k == 0 else -1 if k == 1 else wave.cols if k == 2 else -wave.cols)
            cost = wave.table[wave.costs[neighbour]]
            if wave.queued[neighbour] == NOW or not cost < INFINITE:
                continue
            if not (
                is_open or is_inside(neighbour // wave.cols, neighbour % wave.cols, wave.rows, wave.cols, 1)
            ):
                continue
            if potential_at(wave.potential, neighbour) > value + LATERAL * cost:
                now[n_now] = neighbour
                wave.queued[neighbour] = NOW
                n_now += 1
    reached[:] = top, left, bottom, right
    return Buckets(now, later, reached), BucketState(i, n_now, n_later, limit), budget


@kernel
def dijkstra_slice(
    wave: Wavefront, buckets: Buckets, progress: BucketState, target: int, margin: float, budget: int
) -> tuple[Buckets, BucketState, bool]:
    """Expand up to `budget` cells, bucket by bucket; return also whether the search has ended."""
    while True:
        buckets, progress, budget = expand_bucket(wave, buckets, progress, budget)
        if progress.next < progress.n_now:
            return buckets, progress, False
        end = np.inf
        if target >= 0 and wave.potential[target] > 0.0:
            end = float(wave.potential[target]) + margin
        if progress.limit >= end or progress.n_later == 0:
            return buckets, progress, True
        buckets = Buckets(buckets.later, buckets.now, buckets.reached)
        progress = BucketState(0, progress.n_later, 0, min(progress.limit + BUCKET, end))


def search_dijkstra(
    cells: CellCosts, source: int, target: int, guided: bool, margin: float
) -> Search[CostArray]:
    """Return the potential of every cell that the search reached, shape (rows * cols,), float32; else 0.

    `potential_at` reads it. The source has `SOURCE`.

    Parameters
    ----------
    source, target : int
        Flat indices of cells that can be entered. The search ends `margin` beyond the target's potential,
        or covers all with target -1.
    guided : bool
        Expand cells near the target first (A*'s order). The potential along the cheapest path is the same.
    """
    rows, cols = cells.costs.shape
    reached = reached_from(*divmod(source, cols))
    potential = sparse_zeros(rows, cols, np.float32, reached)
    queued = sparse_zeros(rows, cols, np.uint8, reached)
    is_guided = guided and target >= 0
    target_row, target_col = divmod(target, cols)
    wave = Wavefront(
        cells.costs.ravel(), cells.table, potential, queued, rows, cols, is_guided, target_row, target_col
    )
    buckets = Buckets(np.empty(16384, np.int32), np.empty(16384, np.int32), reached)
    potential[source] = SOURCE
    n_now = 0
    for step in (1, -1, cols, -cols):
        if cost_at(cells, *divmod(source + step, cols)) < INFINITE:
            buckets.now[n_now] = source + step
            queued[source + step] = NOW
            n_now += 1
    limit = float(BUCKET)
    if is_guided:
        limit += math.hypot(source // cols - target_row, source % cols - target_col)
    progress, is_over = BucketState(0, n_now, 0, limit), n_now == 0
    while not is_over:
        buckets, progress, is_over = dijkstra_slice(wave, buckets, progress, target, margin, DIJKSTRA_CELLS)
        if not is_over:
            yield
    return potential


def dijkstra(cells: CellCosts, source: int, target: int, guided: bool, margin: float) -> CostArray:
    """Run `search_dijkstra` at once; return the potential: inf where it did not arrive, 0 at the source."""
    potential = run_to_end(search_dijkstra(cells, source, target, guided, margin))
    return np.where(potential == 0.0, INFINITE, np.where(potential == SOURCE, np.float32(0.0), potential))
