"""Hybrid A* over position and heading, checking the whole footprint. A kernel.

Dolgov et al., "Practical Search Techniques in Path Planning for Autonomous Driving" (2008): positions are
continuous, and one node is kept per bin of position and heading. Here the robot can also rotate in place.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.common.resumable import LATTICE_NODES, Search
from thumper.navigation.costmap.footprint_collision import CollisionGrid, lethal_count, touches_more
from thumper.navigation.costmap.inflation import IntArray
from thumper.navigation.planners.binary_heap import doubled, heap_pop, heap_push
from thumper.navigation.planners.cell_costs import CellCosts, CostArray, cost_at
from thumper.navigation.planners.dijkstra import potential_at
from thumper.navigation.planners.sparse_memory import Reached, extend, reached_from, sparse_zeros

HEADINGS = 24
TURN_RAD = math.tau / HEADINGS
BIN_CELLS = 2  # side of a position bin [cells]
STEP_CELLS = 3.0  # length of a move; longer than a bin's diagonal, so that each move leaves its bin
MOVES = 8
MAX_CELL_COST = 20.0
FIRST_NODES = 4096
GOES_ON, NO_PATH = -1, -2


class LatticeProblem(NamedTuple):
    """What is searched; all lengths in cells."""

    cells: CellCosts
    potential: CostArray  # shape (rows * cols,), from the end, as `search_dijkstra` returns it
    grid: CollisionGrid  # in cells; its own cells may be finer
    roomy: CollisionGrid  # the same with a larger outline: what it touches is tight
    starts: FloatArray  # x, y, theta, shape (n, 3); the headings differ by multiples of TURN_RAD
    start_costs: FloatArray  # shape (n,)
    end: FloatArray  # x, y
    end_radius: float  # a pose this near to the end ends the search
    robot: FloatArray  # x, y, theta
    backward: bool  # from poses at the goal to the robot, against the motion


class LatticeWeights(NamedTuple):
    """What moves cost and where the search stops; all lengths in cells."""

    turn: float  # cost of a turn, per radian
    reverse: float  # factor on the cost of driving backward
    heuristic: float  # >= 1; more finds a path sooner, which costs at most this factor more
    escape_radius: float  # this near to the start the footprint may touch what it touches there
    max_nodes: int
    known_ground: bool  # whether moves backward and rotations need known ground
    tight: float  # cost of a move to a tight pose


class Nodes(NamedTuple):
    """The search tree, one entry per node."""

    x: FloatArray
    y: FloatArray
    cost: FloatArray
    heading: IntArray  # in steps of TURN_RAD from the start's
    parent: IntArray
    closed: NDArray[np.bool_]


@kernel
def with_roots(starts: FloatArray, costs: FloatArray) -> Nodes:
    """Return the tree that holds the starts, shape (n, 3), n <= FIRST_NODES."""
    nodes = Nodes(
        np.empty(FIRST_NODES),
        np.empty(FIRST_NODES),
        np.empty(FIRST_NODES),
        np.empty(FIRST_NODES, np.int32),
        np.empty(FIRST_NODES, np.int32),
        np.zeros(FIRST_NODES, np.bool_),
    )
    for i in range(starts.shape[0]):
        nodes.x[i], nodes.y[i], nodes.cost[i], nodes.parent[i] = starts[i, 0], starts[i, 1], costs[i], -1
        nodes.heading[i] = round((starts[i, 2] - starts[0, 2]) / TURN_RAD) % HEADINGS
    return nodes


@kernel
def larger(nodes: Nodes) -> Nodes:
    """Return the nodes in arrays of twice the length."""
    return Nodes(
        doubled(nodes.x),
        doubled(nodes.y),
        doubled(nodes.cost),
        doubled(nodes.heading),
        doubled(nodes.parent),
        np.concatenate((nodes.closed, np.zeros(nodes.closed.size, np.bool_))),
    )


@kernel
def motion_of(move: int) -> tuple[int, float]:
    """Return the change of heading [TURN_RAD] and the length of a move.

    0 ... 4: arcs ahead by -2 ... 2 headings; 5: straight back; 6, 7: rotations in place.
    """
    change = move - 2 if move < 5 else (0 if move == 5 else 2 * move - 13)
    length = STEP_CELLS if move < 5 else (-STEP_CELLS if move == 5 else 0.0)
    return change, length


@kernel
def moved(x: float, y: float, mean_theta: float, length: float) -> tuple[float, float]:
    """Return the place at the end of a move."""
    return x + length * math.cos(mean_theta), y + length * math.sin(mean_theta)


@kernel
def is_free(
    grid: CollisionGrid, x: float, y: float, theta: float, allowed: int, unknown_blocks: bool
) -> bool:
    """Return whether at most `allowed` outline points are on obstacles (or unknown cells if these block)."""
    return not touches_more(grid, unknown_blocks, x, y, theta, allowed)


@kernel
def turn_is_free(problem: LatticeProblem, theta: float, allowed: int, unknown_blocks: bool) -> bool:
    """Return whether the robot can turn to a heading on the spot, by the smaller angle."""
    x, y, start = problem.robot
    angle = (theta - start + math.pi) % math.tau - math.pi
    count = math.ceil(2.0 * abs(angle) / TURN_RAD)
    for i in range(1, count + 1):
        if not is_free(problem.grid, x, y, start + angle * i / count, allowed, unknown_blocks):
            return False
    return True


@kernel
def trace_poses(nodes: Nodes, last: int, start_theta: float) -> FloatArray:
    """Return the poses (x, y, theta) from the root to a node, shape (n, 3)."""
    count = 0
    node = last
    while node >= 0:
        count += 1
        node = nodes.parent[node]
    poses = np.empty((count, 3))
    node = last
    for i in range(count - 1, -1, -1):
        poses[i, 0], poses[i, 1] = nodes.x[node], nodes.y[node]
        poses[i, 2] = start_theta + nodes.heading[node] * TURN_RAD
        node = nodes.parent[node]
    return poses


@kernel
def move_is_free(
    problem: LatticeProblem,
    start: tuple[float, float, float],
    motion: tuple[int, float],
    allowed: int,
    needs_known: bool,
) -> bool:
    """Return whether the footprint is free at the end and in the middle of a move from `start`."""
    x, y, theta = start
    change, length = motion
    mean = theta + 0.5 * change * TURN_RAD
    nx, ny = moved(x, y, mean, length)
    if not is_free(problem.grid, nx, ny, theta + change * TURN_RAD, allowed, needs_known):
        return False
    mx, my = moved(x, y, theta + 0.25 * change * TURN_RAD, 0.5 * length)
    return is_free(problem.grid, mx, my, mean, allowed, needs_known)


@kernel
def cost_of_room(
    problem: LatticeProblem,
    weights: LatticeWeights,
    start: tuple[float, float, float],
    motion: tuple[int, float],
    touching: int,
    needs_known: bool,
) -> float:
    """Return what a move costs more because it is tight; inf if it is not free."""
    x, y, theta = start
    change, length = motion
    nx, ny = moved(x, y, theta + 0.5 * change * TURN_RAD, length)
    near = math.hypot(nx - problem.robot[0], ny - problem.robot[1]) < weights.escape_radius
    if not move_is_free(problem, start, motion, touching if near else 0, needs_known):
        return np.inf
    if weights.tight == 0.0 or is_free(problem.roomy, nx, ny, theta + change * TURN_RAD, 0, False):
        return 0.0
    return weights.tight


class Bins(NamedTuple):
    """The bins of position and heading, rows of bins by columns of bins times headings."""

    node_at: IntArray  # flat: the node of each bin plus 1
    reached: Reached  # box round the bins with a node


class SearchState(NamedTuple):
    """How far the search is."""

    nodes: Nodes
    keys: FloatArray  # of the heap of open nodes
    items: IntArray
    size: int  # of the heap
    made: int  # number of nodes
    last: int  # the node at the goal; -1 while the search goes on, -2 if there is no path


@kernel
def with_room(
    nodes: Nodes, keys: FloatArray, items: IntArray, size: int, count: int
) -> tuple[Nodes, FloatArray, IntArray]:
    """Return nodes and heap with room for one more entry."""
    if count == nodes.x.size:
        nodes = larger(nodes)
    if size == keys.size:
        keys, items = doubled(keys), doubled(items)
    return nodes, keys, items


@kernel
def lattice_slice(
    problem: LatticeProblem, weights: LatticeWeights, bins: Bins, progress: SearchState, budget: int
) -> SearchState:
    """Close up to `budget` nodes."""
    start, robot, direction = problem.starts[0], problem.robot, -1 if problem.backward else 1
    rows, cols = problem.cells.costs.shape
    nodes, keys, items, size, count, last = progress
    touching = max(0, lethal_count(problem.grid, False, robot[0], robot[1], robot[2]))
    while budget > 0 and size > 0 and count < weights.max_nodes:
        node = heap_pop(keys, items, size)
        size -= 1
        if nodes.closed[node]:
            continue
        nodes.closed[node] = True
        budget -= 1
        x, y = nodes.x[node], nodes.y[node]
        theta = start[2] + nodes.heading[node] * TURN_RAD
        if math.hypot(x - problem.end[0], y - problem.end[1]) <= problem.end_radius and (
            not problem.backward or turn_is_free(problem, theta, touching, weights.known_ground)
        ):
            last = node
            break
        for move in range(MOVES):
            change, length = motion_of(move)
            needs_known = weights.known_ground and length <= 0.0
            weight = weights.reverse if length < 0.0 else 1.0  # of the robot's motion
            change, length = direction * change, direction * length
            nx, ny = moved(x, y, theta + 0.5 * change * TURN_RAD, length)
            col, row = math.floor(nx), math.floor(ny)
            if not (1 <= col < cols - 1 and 1 <= row < rows - 1):
                continue
            remaining = potential_at(problem.potential, row * cols + col)
            if not remaining < np.inf:
                continue
            heading = (nodes.heading[node] + change) % HEADINGS
            bin_row, bin_col = row // BIN_CELLS, (col // BIN_CELLS) * HEADINGS + heading
            slot = bin_row * (cols // BIN_CELLS + 1) * HEADINGS + bin_col
            other = bins.node_at[slot] - 1
            cell_cost = min(float(cost_at(problem.cells, row, col)), MAX_CELL_COST)
            cost = nodes.cost[node] + abs(change) * TURN_RAD * weights.turn + abs(length) * cell_cost * weight
            if other >= 0 and (nodes.closed[other] or nodes.cost[other] <= cost):
                continue
            cost += cost_of_room(problem, weights, (x, y, theta), (change, length), touching, needs_known)
            if not cost < np.inf or (other >= 0 and nodes.cost[other] <= cost):
                continue
            nodes, keys, items = with_room(nodes, keys, items, size, count)
            if other >= 0:
                nodes.closed[other] = True  # a cheaper node replaces it
            nodes.x[count], nodes.y[count], nodes.cost[count] = nx, ny, cost
            nodes.heading[count], nodes.parent[count] = heading, node
            bins.node_at[slot] = count + 1
            extend(bins.reached, bin_row, bin_col)
            heap_push(keys, items, size, cost + weights.heuristic * remaining, count)
            size, count = size + 1, count + 1
    if last == GOES_ON and budget > 0:
        last = NO_PATH
    return SearchState(nodes, keys, items, size, count, last)


def search_lattice(problem: LatticeProblem, weights: LatticeWeights) -> Search[FloatArray]:
    """Return poses (x, y, theta), shape (n, 3), in the order of the motion; empty if there are none.

    They lead from the start to near the end; if `backward`, from near the robot to one of the starts. The
    headings are continuous: a turn to the right begins with a smaller heading, not with one near 2 pi.
    Gives up after `max_nodes` nodes. The footprint must be free everywhere but near the robot.
    """
    rows, cols = problem.cells.costs.shape
    bin_rows, bin_cols = rows // BIN_CELLS + 1, (cols // BIN_CELLS + 1) * HEADINGS
    row, col = int(problem.starts[0, 1]) // BIN_CELLS, int(problem.starts[0, 0]) // BIN_CELLS * HEADINGS
    reached = reached_from(row, col)
    bins = Bins(sparse_zeros(bin_rows, bin_cols, np.int32, reached), reached)
    keys, items = np.empty(FIRST_NODES), np.empty(FIRST_NODES, np.int32)
    count = len(problem.starts)
    for i, (x, y, _) in enumerate(problem.starts):
        left = potential_at(problem.potential, int(y) * cols + int(x))
        heap_push(keys, items, i, problem.start_costs[i] + weights.heuristic * float(left), i)
    nodes = with_roots(problem.starts, problem.start_costs)
    progress = SearchState(nodes, keys, items, count, count, GOES_ON)
    while True:
        progress = lattice_slice(problem, weights, bins, progress, LATTICE_NODES)
        if progress.last == NO_PATH:
            return np.empty((0, 3))
        if progress.last >= 0:
            poses = trace_poses(progress.nodes, progress.last, problem.starts[0, 2])
            poses[:, 2] = np.unwrap(poses[:, 2])
            return np.ascontiguousarray(poses[::-1]) if problem.backward else poses
        yield
