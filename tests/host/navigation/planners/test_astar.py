"""A* against Dijkstra and published optimal lengths, and the paths of its planner."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from thumper.common.geometry import FloatArray, Pose2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar import AStarPlanner, is_blocked
from thumper.navigation.planners.astar_search import NO_GOAL, astar, trace_path
from thumper.navigation.planners.cell_costs import CellCosts
from thumper.navigation.planners.polyline import arc_lengths
from thumper.navigation.planners.traversal_cost import TraversalCostOptions
from thumper_hil.kinematic.maps import read_octile

NO_HITS = np.empty((0, 2))


def walled(cell_costs: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.pad(cell_costs, 1, constant_values=np.inf).astype(np.float32)


def looked_up(cell_costs: NDArray[np.float32]) -> CellCosts:
    """Return at most 256 different costs as a costmap and its table."""
    table, costs = np.unique(cell_costs, return_inverse=True)
    return CellCosts(
        costs.reshape(cell_costs.shape).astype(np.uint8), np.resize(table.astype(np.float32), 256)
    )


def reference_costs(cell_costs: NDArray[np.float32], start: int) -> FloatArray:
    """Return the costs by scipy's Dijkstra on the same graph, written independently of the kernel."""
    rows, cols = cell_costs.shape
    edges: list[tuple[int, int, float]] = []
    for row in range(rows):
        for col in range(cols):
            for d_row, d_col in ((0, 1), (1, 0), (1, 1), (1, -1)):
                r, c = row + d_row, col + d_col
                if not (0 <= r < rows and 0 <= c < cols):
                    continue
                if not np.isfinite(
                    [cell_costs[row, col], cell_costs[r, c], cell_costs[row, c], cell_costs[r, col]]
                ).all():
                    continue
                cost = math.hypot(d_row, d_col) * 0.5 * float(cell_costs[row, col] + cell_costs[r, c])
                edges.append((row * cols + col, r * cols + c, cost))
    if not edges:
        return np.where(np.arange(rows * cols) == start, 0.0, np.inf)
    tails, heads, costs = (np.array(column) for column in zip(*edges, strict=True))
    graph = coo_array((costs, (tails, heads)), shape=(rows * cols, rows * cols)).tocsr()
    return np.asarray(dijkstra(graph, directed=False, indices=start))


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    rows=st.integers(2, 14),
    cols=st.integers(2, 14),
    density=st.floats(0, 0.45),
    weight=st.sampled_from([0.0, 5.0]),
)
def test_path_cost_is_optimal(seed: int, rows: int, cols: int, density: float, weight: float) -> None:
    rng = np.random.default_rng(seed)
    cell_costs = (1.0 + weight * rng.random((rows, cols)).round(2)).astype(np.float32)
    cell_costs[rng.random((rows, cols)) < density] = np.inf
    cell_costs[0, 0] = 1.0
    cell_costs = walled(cell_costs)
    start, goal = cell_costs.shape[1] + 1, rows * cell_costs.shape[1] + cols
    expected = reference_costs(cell_costs, start)
    flooded, _ = astar(looked_up(cell_costs), start, NO_GOAL)
    np.testing.assert_allclose(flooded, expected)
    cost, parent = astar(looked_up(cell_costs), start, goal)
    assert cost[goal] == pytest.approx(expected[goal])
    if np.isfinite(cost[goal]):
        cells = trace_path(parent, goal)
        assert (cells[0], cells[-1]) == (start, goal)
        assert np.isfinite(cell_costs.ravel()[cells]).all()
        steps = np.abs(np.diff(np.column_stack(np.divmod(cells, cell_costs.shape[1])), axis=0))
        assert steps.max(initial=1) == 1


@pytest.mark.parametrize("name", ["Berlin_1_512", "16room_000"])
def test_published_optimal_lengths(nav_data: Path, name: str) -> None:
    cell_costs = walled(
        np.where(read_octile(nav_data / "movingai" / f"{name}.map"), 1.0, np.inf).astype(np.float32)
    )
    lines = (nav_data / "movingai" / f"{name}.map.scen").read_text().splitlines()[1:]
    cols = cell_costs.shape[1]
    ground = looked_up(cell_costs)
    for line in lines[-1 :: -max(1, len(lines) // 40)]:
        *_, x0, y0, x1, y1, length = line.split()
        goal = (int(y1) + 1) * cols + int(x1) + 1
        cost, _ = astar(ground, (int(y0) + 1) * cols + int(x0) + 1, goal)
        assert cost[goal] == pytest.approx(float(length), abs=1e-3)  # the file is rounded


def costmap_of(cells: NDArray[np.int8]) -> Costmap:
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    return build_costmap(grid, NO_HITS, Footprint(), CostmapOptions())


def room_with_wall() -> NDArray[np.int8]:
    """Return 5 m x 5 m with a wall at x = 2.5 m and a doorway of 0.8 m at y = 3.6 ... 4.4 m."""
    cells = np.zeros((100, 100), np.int8)
    cells[:, 50] = 100
    cells[72:88, 50] = 0
    return cells


START = Pose2(x_m=1.0, y_m=1.0)


def test_path_leads_through_the_middle_of_the_door_to_the_goal() -> None:
    costmap = costmap_of(room_with_wall())
    result = AStarPlanner(TraversalCostOptions()).plan(costmap, START, Goal(x_m=4.03, y_m=1.01))
    assert result.path_m is not None
    path_m = result.path_m
    assert path_m[0] == pytest.approx((1.0, 1.0))
    assert path_m[-1] == pytest.approx((4.03, 1.01))
    assert not is_blocked(costmap, path_m)
    door_y_m = path_m[np.argmin(np.abs(path_m[:, 0] - 2.525)), 1]
    assert 3.8 < door_y_m < 4.2
    spacing = np.diff(arc_lengths(path_m))
    assert spacing.max() < 0.06
    assert result.reason == ""


def test_path_in_free_space_is_straight() -> None:
    costmap = costmap_of(np.zeros((100, 100), np.int8))
    result = AStarPlanner(TraversalCostOptions()).plan(costmap, START, Goal(x_m=4.0, y_m=2.2))
    assert result.path_m is not None
    assert arc_lengths(result.path_m)[-1] == pytest.approx(math.hypot(3.0, 1.2), rel=1e-3)


def test_reasons_without_a_path() -> None:
    cells = room_with_wall()
    cells[72:88, 50] = 100
    planner = AStarPlanner(TraversalCostOptions())
    result = planner.plan(costmap_of(cells), START, Goal(x_m=4.0, y_m=1.0))
    assert result.path_m is None
    assert "shut off by obstacles" in result.reason
    result = planner.plan(costmap_of(cells), START, Goal(x_m=2.52, y_m=1.0))
    assert result.path_m is None
    assert "obstacle" in result.reason
    result = planner.plan(costmap_of(cells), START, Goal(x_m=9.0, y_m=1.0))
    assert "outside the map" in result.reason


def test_goal_in_an_obstacle_is_replaced_within_the_tolerance() -> None:
    goal = Goal(x_m=2.52, y_m=1.0, tolerance_m=0.3)
    result = AStarPlanner(TraversalCostOptions()).plan(costmap_of(room_with_wall()), START, goal)
    assert result.path_m is not None
    assert math.dist(result.path_m[-1], (2.52, 1.0)) <= 0.3
    assert "instead" in result.reason


def test_start_near_a_wall_has_a_path_and_one_inside_has_none() -> None:
    planner, goal = AStarPlanner(TraversalCostOptions()), Goal(x_m=1.0, y_m=1.0)
    near = planner.plan(costmap_of(room_with_wall()), Pose2(x_m=2.45, y_m=1.0), goal)
    assert near.path_m is not None
    assert near.path_m[0] == pytest.approx((2.45, 1.0))
    block = np.zeros((100, 100), np.int8)
    block[60:90, 60:90] = 100
    inside = planner.plan(costmap_of(block), Pose2(x_m=3.75, y_m=3.75), goal)
    assert inside.path_m is None
    assert "inside an obstacle" in inside.reason


def test_unknown_space_costs_more_and_can_be_forbidden() -> None:
    cells = np.zeros((100, 100), np.int8)
    cells[:80, 40:60] = -1  # known space leads round the top
    goal = Goal(x_m=4.0, y_m=1.0)
    lengths = {}
    for weight in (0.0, 20.0):
        result = AStarPlanner(TraversalCostOptions(unknown_weight=weight)).plan(
            costmap_of(cells), START, goal
        )
        assert result.path_m is not None
        lengths[weight] = arc_lengths(result.path_m)[-1]
    assert lengths[0.0] == pytest.approx(3.0, rel=1e-3)
    assert lengths[20.0] > 5.0
    cells[:, 40:60] = -1
    assert (
        AStarPlanner(TraversalCostOptions(allow_unknown=False)).plan(costmap_of(cells), START, goal).path_m
        is None
    )
