"""A wave of travel cost over a grid, for navfn and as what the lattice search still has to go. A kernel in
cells.

The wave solves |grad potential| = price: each cell takes its value from its cheaper neighbour across and its
cheaper one along, so the potential has no octile kinks (Sethian, "A fast marching level set method", 1996).
Instead of a heap two buckets hold the front: a cell that gets cheaper later is simply expanded again (label
correcting), so the result does not depend on the order.
"""

import math

import numpy as np

from thumper.common.numba_kernel import kernel
from thumper.navigation.planners.astar_search import CostArray

BUCKET = np.float32(
    16.0
)  # width of a bucket [free cells]: wide ones re-expand a little, narrow ones rescan a lot
NEITHER, NOW, LATER = 0, 1, 2
HALF, TWO, INFINITE = np.float32(0.5), np.float32(2.0), np.float32(np.inf)
LATERAL = np.float32(math.sqrt(0.5))  # a front that arrives diagonally gains at least this part of a price


@kernel
def dijkstra(prices: CostArray, source: int, target: int, guided: bool, margin: float) -> CostArray:
    """Potential of every cell that the wave met, shape (rows * cols,), float32; inf elsewhere.

    Parameters
    ----------
    prices : ndarray, shape (rows, cols), float32
        Price of a cell's width, >= 1; inf is an obstacle. The border cells must all be inf.
    source, target : int
        Flat indices; the wave ends `margin` beyond the target's potential, or floods all with target -1.
    guided : bool
        Expand cells nearer to the target first (A*'s order); the potential along the cheapest way is the
        same.
    """
    rows, cols = prices.shape
    price = prices.ravel()
    potential = np.full(rows * cols, INFINITE, np.float32)
    queue = np.zeros(rows * cols, np.uint8)
    now, later = np.empty(16384, np.int32), np.empty(16384, np.int32)
    target_row, target_col = target // cols, target % cols
    potential[source] = 0.0
    n_now, n_later = 0, 0
    for step in (1, -1, cols, -cols):
        if price[source + step] < INFINITE:
            now[n_now] = source + step
            queue[source + step] = NOW
            n_now += 1
    guided = guided and target >= 0
    limit = BUCKET
    if guided:
        limit += np.float32(math.hypot(source // cols - target_row, source % cols - target_col))
    end = INFINITE
    while n_now > 0:
        i = 0
        while i < n_now:
            cell = int(now[i])
            i += 1
            queue[cell] = NEITHER
            here = price[cell]
            right, left = potential[cell + 1], potential[cell - 1]
            up, down = potential[cell + cols], potential[cell - cols]
            across, along = min(left, right), min(up, down)
            low, high = min(across, along), max(across, along)
            gap = high - low
            value = (
                low + here if gap >= here else HALF * (low + high + math.sqrt(TWO * here * here - gap * gap))
            )
            if value >= potential[cell]:
                continue
            rank = value
            if guided:
                row = cell // cols
                dy, dx = np.float32(row - target_row), np.float32(cell - row * cols - target_col)
                rank += math.sqrt(dx * dx + dy * dy)
            if rank >= limit:
                # Not its turn yet: the cell comes back with the next bucket, when its neighbours are settled.
                if n_later == later.size:
                    later = np.concatenate((later, np.empty(later.size, np.int32)))
                later[n_later] = cell
                n_later += 1
                queue[cell] = LATER
                continue
            potential[cell] = value
            if n_now + 4 > now.size:
                now = np.concatenate((now, np.empty(now.size, np.int32)))
            for step in (1, -1, cols, -cols):
                neighbour = cell + step
                if queue[neighbour] == NOW or not price[neighbour] < INFINITE:
                    continue
                if potential[neighbour] > value + LATERAL * price[neighbour]:
                    now[n_now] = neighbour
                    queue[neighbour] = NOW
                    n_now += 1
        if target >= 0 and potential[target] < INFINITE:
            end = potential[target] + np.float32(margin)
        if limit >= end:
            break
        now, later = later, now
        n_now, n_later = n_later, 0
        limit += BUCKET
    return potential
