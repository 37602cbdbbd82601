"""A* over place and heading with the robot's whole outline: ways that can be driven, turns included. A
kernel.

After Dolgov et al., "Practical Search Techniques in Path Planning for Autonomous Driving" (2008): places are
continuous, one node is kept for each bin of place and heading; here a robot that may also turn on the spot.
"""

import math

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.costmap.footprint_collision import Ground, lethal_count
from thumper.navigation.planners.astar_search import CostArray, _drop_root, _grown, _push

HEADINGS = 24
TURN_RAD = math.tau / HEADINGS
BIN_CELLS = 2  # side of a place bin [cells]
STEP_CELLS = 3.0  # length of a move; longer than a bin's diagonal, so that each move leaves its bin


@kernel
def search_poses(
    prices: CostArray,
    potential: CostArray,
    ground: Ground,
    start: FloatArray,
    goal: FloatArray,
    near: float,
    turn_price: float,
    back_price: float,
    greed: float,
    escape: float,
    most: int,
) -> FloatArray:
    """Poses (x, y, theta), shape (n, 3), from the start to within `near` of the goal; empty when there is
    none.

    All lengths are in cells; `prices`, `potential` (from the goal) as in `wavefront.flood`. A turn costs
    `turn_price` for each radian, a cell backward `back_price` times its price. `greed` >= 1 weighs what is
    left to go: more finds a way sooner, which costs at most this much more. Gives up after `most` nodes. The
    outline must be free everywhere but within `escape` of the start, where it may touch what
    it touches.
    """
    rows, cols = prices.shape
    bins_x = cols // BIN_CELLS + 1
    nodes = np.full((rows // BIN_CELLS + 1) * bins_x * HEADINGS, -1, np.int32)
    x, y, way = np.empty(4096), np.empty(4096), np.empty(4096)
    turn, parent = np.empty(4096, np.int32), np.empty(4096, np.int32)
    closed: NDArray[np.bool_] = np.zeros(4096, np.bool_)
    keys, items = np.empty(4096), np.empty(4096, np.int32)
    touching = max(0, lethal_count(ground, False, start[0], start[1], start[2]))
    x[0], y[0], way[0], turn[0], parent[0] = start[0], start[1], 0.0, 0, -1
    _push(keys, items, 0, 0.0, 0)
    size, count, found = 1, 1, -1
    while size > 0 and count < most:
        node = items[0]
        _drop_root(keys, items, size)
        size -= 1
        if closed[node]:
            continue
        closed[node] = True
        if math.hypot(x[node] - goal[0], y[node] - goal[1]) <= near:
            found = node
            break
        theta = start[2] + turn[node] * TURN_RAD
        for move in range(8):
            # 0 ... 4: arcs ahead by -2 ... 2 headings; 5: straight back; 6, 7: turns on the spot
            change = move - 2 if move < 5 else (0 if move == 5 else 2 * move - 13)
            length = STEP_CELLS if move < 5 else (-STEP_CELLS if move == 5 else 0.0)
            mean = theta + 0.5 * change * TURN_RAD
            nx, ny = x[node] + length * math.cos(mean), y[node] + length * math.sin(mean)
            col, row = math.floor(nx), math.floor(ny)
            if col < 1 or row < 1 or col >= cols - 1 or row >= rows - 1:
                continue
            left = potential[row * cols + col]
            if not left < np.inf:
                continue
            after = (turn[node] + change) % HEADINGS
            slot = ((row // BIN_CELLS) * bins_x + col // BIN_CELLS) * HEADINGS + after
            other = nodes[slot]
            if other >= 0 and closed[other]:
                continue
            price = min(prices[row, col], 20.0)
            cost = way[node] + abs(change) * TURN_RAD * turn_price
            cost += abs(length) * price * (back_price if move == 5 else 1.0)
            if other >= 0 and way[other] <= cost:
                continue
            allowed = touching if math.hypot(nx - start[0], ny - start[1]) < escape else 0
            quarter = theta + 0.25 * change * TURN_RAD
            mx = x[node] + 0.5 * length * math.cos(quarter)
            my = y[node] + 0.5 * length * math.sin(quarter)
            meets = lethal_count(ground, False, nx, ny, theta + change * TURN_RAD)
            if meets < 0 or meets > allowed:
                continue
            meets = lethal_count(ground, False, mx, my, mean)
            if meets < 0 or meets > allowed:
                continue
            if count == x.size:
                x, y, way = _grown(x), _grown(y), _grown(way)
                turn, parent = _grown(turn), _grown(parent)
                closed = np.concatenate((closed, np.zeros(closed.size, np.bool_)))
            if size == keys.size:
                keys, items = _grown(keys), _grown(items)
            if other >= 0:
                closed[other] = True  # beaten before its turn
            x[count], y[count], way[count], turn[count], parent[count] = nx, ny, cost, after, node
            nodes[slot] = count
            _push(keys, items, size, cost + greed * left, count)
            size += 1
            count += 1
    if found < 0:
        return np.empty((0, 3))
    length_nodes = 0
    node = found
    while node >= 0:
        length_nodes += 1
        node = parent[node]
    poses = np.empty((length_nodes, 3))
    node = found
    for i in range(length_nodes - 1, -1, -1):
        poses[i, 0], poses[i, 1], poses[i, 2] = x[node], y[node], start[2] + turn[node] * TURN_RAD
        node = parent[node]
    return poses
