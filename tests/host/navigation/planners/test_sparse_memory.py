"""Memory that one search has written is zero for the next one, and never given to two at once."""

import gc

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners import sparse_memory
from thumper.navigation.planners.astar import AStarPlanner
from thumper.navigation.planners.lattice import LatticeOptions, LatticePlanner
from thumper.navigation.planners.navfn import NavfnPlanner
from thumper.navigation.planners.planner import Planner
from thumper.navigation.planners.sparse_memory import extend, reached_from, sparse_zeros
from thumper.navigation.planners.traversal_cost import TraversalCostOptions

SIDE = 1200  # a float32 for each cell is a large array


@pytest.fixture(autouse=True)
def no_kept_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sparse_memory, "_free", [])
    monkeypatch.setattr(sparse_memory, "LARGE_BYTES", SIDE * SIDE)  # bytes for each cell, too


def written(row: int, col: int, size: int) -> None:
    """Write a square, as a search does: the box, and the cells next to it."""
    reached = reached_from(row, col)
    array = sparse_zeros(SIDE, SIDE, np.float32, reached)
    assert not array.any()
    extend(reached, row + size, col - size)
    array.reshape(SIDE, SIDE)[max(0, row - 1) : row + size + 2, max(0, col - size - 1) : col + 2] = 1.0


def test_kept_memory_is_zero() -> None:
    rng = np.random.default_rng(0)
    for row, col in ((0, 50), (SIDE - 1, SIDE - 1), *rng.integers(60, SIDE - 60, (20, 2)).tolist()):
        written(row, col, int(rng.integers(0, 50)))
        assert len(sparse_memory._free) == 1


def test_memory_in_use_is_not_given_away() -> None:
    first = sparse_zeros(SIDE, SIDE, np.float32, reached_from(3, 3))
    part = first.reshape(SIDE, SIDE)[2:5, 2:5]
    del first
    gc.collect()
    other = sparse_zeros(SIDE, SIDE, np.float32, reached_from(3, 3))
    other.reshape(SIDE, SIDE)[2:5, 2:5] = 7.0
    assert not part.any()
    del part
    assert len(sparse_memory._free) == 1


def test_memory_that_searches_have_filled_is_returned(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sparse_memory, "MOST_KEPT_BYTES", 100_000)
    written(50, 50, 9)
    assert len(sparse_memory._free) == 1
    written(500, 500, 200)
    assert not sparse_memory._free


def test_as_much_memory_is_kept_as_two_searches_need() -> None:
    arrays = [sparse_zeros(SIDE, SIDE, np.float32, reached_from(1, 1)) for _ in range(sparse_memory.KEPT + 3)]
    arrays.clear()
    assert len(sparse_memory._free) == sparse_memory.KEPT


def some_costmap(rng: np.random.Generator) -> Costmap:
    """Return a large costmap with scattered costs and walls, except near its middle."""
    costs = np.where(rng.random((SIDE, SIDE)) < 0.03, 200, 0).astype(np.uint8)
    for row, col in rng.integers(0, SIDE, (2000, 2)):
        costs[row : row + 8, col : col + 3] = 254
    return Costmap(
        costs=costs,
        squared_cells=np.where(costs == 254, 0, 10_000).astype(np.int32),
        resolution_m=0.05,
        origin_x_m=-0.025 * SIDE,
        origin_y_m=-0.025 * SIDE,
    )


@pytest.mark.parametrize("name", ["astar", "navfn", "lattice"])
def test_plans_equal_those_in_fresh_memory(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    rng, options = np.random.default_rng(3), TraversalCostOptions()
    costmap = some_costmap(rng)
    planners: dict[str, Planner] = {
        "astar": AStarPlanner(options),
        "navfn": NavfnPlanner(options),
        "lattice": LatticePlanner(LatticeOptions(), options, Footprint()),
    }
    planner, used, paths = planners[name], 0, 0
    for _ in range(12):
        start = Pose2(x_m=float(rng.uniform(-2.0, 2.0)), y_m=float(rng.uniform(-2.0, 2.0)))
        goal = Goal(x_m=float(rng.uniform(-4.0, 4.0)), y_m=float(rng.uniform(-4.0, 4.0)))
        used += len(sparse_memory._free)
        again = planner.plan(costmap, start, goal)
        with monkeypatch.context() as fresh:
            fresh.setattr(sparse_memory, "_free", [])
            new = planner.plan(costmap, start, goal)
        assert again.reason == new.reason
        assert (again.path_m is None) == (new.path_m is None)
        if again.path_m is not None and new.path_m is not None:
            np.testing.assert_array_equal(again.path_m, new.path_m)
            paths += len(new.path_m) > 10
    assert used > 10
    assert paths > 6
