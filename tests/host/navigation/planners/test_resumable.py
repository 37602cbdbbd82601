"""Searches in slices: bounded work in each, the same result as at once."""

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.common.resumable import ASTAR_CELLS, BAND_CELLS, DIJKSTRA_CELLS, Search
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap import bands
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners import astar_search, dijkstra, frontier_exploration
from thumper.navigation.planners.astar import AStarPlanner
from thumper.navigation.planners.frontier_exploration import ExplorationOptions, Explorer, find_frontiers
from thumper.navigation.planners.goal_validation import NEAREST_PLACES, OTHER_PLACES, _places_m
from thumper.navigation.planners.lattice import LatticeOptions, LatticePlanner
from thumper.navigation.planners.navfn import NavfnPlanner
from thumper.navigation.planners.planner import Planner
from thumper.navigation.planners.replanning import PathManager, ReplanningOptions
from thumper.navigation.planners.traversal_cost import TraversalCostOptions

SIDE = 600
START, GOAL = Pose2(x_m=1.5, y_m=1.5), Goal(x_m=27.0, y_m=27.0)
OPTIONS = TraversalCostOptions()
PLANNERS: dict[str, Planner] = {
    "astar": AStarPlanner(OPTIONS),
    "navfn": NavfnPlanner(OPTIONS),
    "lattice": LatticePlanner(LatticeOptions(), OPTIONS, Footprint()),
}


def hall(*, shut: bool) -> Costmap:
    """Return a hall of 30 m with a room round the goal, with or without a door."""
    cells = np.zeros((SIDE, SIDE), np.int8)
    cells[480, 480:] = cells[480:, 480] = 100
    if not shut:
        cells[480, 520:540] = 0
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    return build_costmap(grid, np.empty((0, 2)), Footprint(), CostmapOptions())


def slices(search: Search[object]) -> int:
    return 1 + sum(1 for _ in search)


@pytest.mark.parametrize("name", PLANNERS)
def test_a_search_to_a_shut_off_goal_goes_on_in_later_cycles(name: str) -> None:
    """The whole hall must be searched, 360 000 cells: in several slices, and the reason is the same."""
    costmap = hall(shut=True)
    assert slices(PLANNERS[name].search(costmap, START, GOAL)) >= 5
    result = PLANNERS[name].plan(costmap, START, GOAL)
    assert result.unreachable
    assert "shut off" in result.reason


def test_no_slice_of_astar_closes_more_cells_than_its_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[int] = []
    original = astar_search.astar_slice

    def counted(*given: object) -> object:
        before = int((given[1].status == astar_search.CLOSED).sum())  # type: ignore[attr-defined]
        result = original(*given)  # type: ignore[arg-type]
        closed.append(int((given[1].status == astar_search.CLOSED).sum()) - before)  # type: ignore[attr-defined]
        return result

    monkeypatch.setattr(astar_search, "astar_slice", counted)
    AStarPlanner(OPTIONS).plan(hall(shut=True), START, GOAL)
    assert max(closed) == ASTAR_CELLS
    assert sum(closed) > 300_000


def test_a_path_that_takes_several_cycles_is_the_same() -> None:
    costmap, manager = hall(shut=False), PathManager(AStarPlanner(OPTIONS), ReplanningOptions(), Footprint())
    cycles = 0
    while manager.path_m is None:
        manager.update(0.1 * cycles, costmap, START, GOAL)
        assert manager.is_first_search or manager.path_m is not None
        cycles += 1
    assert cycles > 1
    whole_m = PLANNERS["astar"].plan(costmap, START, GOAL).path_m
    assert whole_m is not None
    assert manager.path_m == pytest.approx(whole_m)


def test_a_path_that_was_blocked_while_the_search_went_on_is_searched_again() -> None:
    costmap, manager = hall(shut=False), PathManager(AStarPlanner(OPTIONS), ReplanningOptions(), Footprint())
    manager.update(0.0, costmap, START, GOAL)
    assert manager.path_m is None
    costmap.costs[:] = hall(shut=True).costs
    for cycle in range(1, 60):
        manager.update(0.1 * cycle, costmap, START, GOAL)
        assert manager.path_m is None
    assert "shut off" in manager.reason


def test_why_there_is_no_path_is_known_while_it_is_searched_again() -> None:
    """After a recovery: a drive that is given up meanwhile must say that the goal is shut off."""
    costmap, manager = hall(shut=True), PathManager(AStarPlanner(OPTIONS), ReplanningOptions(), Footprint())
    cycle = 0
    while not manager.reason:
        manager.update(0.1 * cycle, costmap, START, GOAL)
        cycle += 1
    manager.clear()
    manager.update(0.1 * cycle, costmap, START, GOAL)
    assert manager.is_first_search
    assert "shut off" in manager.reason
    manager.start_goal()
    assert not manager.reason


def test_places_within_a_tolerance_are_bounded() -> None:
    assert len(_places_m(0.05, Goal(x_m=0.0, y_m=0.0, tolerance_m=0.3))) > 100
    assert len(_places_m(0.05, Goal(x_m=0.0, y_m=0.0, tolerance_m=5.0))) <= NEAREST_PLACES + OTHER_PLACES + 1


def islands() -> OccupancyGrid:
    """Return a hall of 60 m with 20 x 20 unknown islands, each with one frontier round it."""
    cells = np.zeros((1200, 1200), np.int8)
    rows = 30 + 57 * np.arange(20)
    for row in rows:
        for col in rows:
            cells[row : row + 20, col : col + 20] = -1
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = 100
    return OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)


def test_hundreds_of_frontiers_are_grouped_in_one_pass() -> None:
    found = find_frontiers(islands(), Pose2(x_m=0.8, y_m=0.8), Footprint(), ExplorationOptions())
    assert len(found) == 400
    assert {round(frontier.length_m, 2) for frontier in found} == {4.2}


def test_each_slice_of_a_search_for_frontiers_does_bounded_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells inflated, cells expanded and lines of sight: no slice does more than its share of any."""
    work = dict.fromkeys(("inflated", "expanded", "sights"), 0)
    build, expand, sees = build_costmap, dijkstra.dijkstra_slice, frontier_exploration._sees

    def counted_build(grid: OccupancyGrid, *given: object) -> object:
        work["inflated"] += grid.cells.size
        return build(grid, *given)  # type: ignore[arg-type]

    def counted_expand(*given: object) -> object:
        work["expanded"] += given[-1]  # type: ignore[operator]  # the budget
        return expand(*given)  # type: ignore[arg-type]

    def counted_sees(*given: object) -> bool:
        work["sights"] += 1
        return sees(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(bands, "build_costmap", counted_build)
    monkeypatch.setattr(dijkstra, "dijkstra_slice", counted_expand)
    monkeypatch.setattr(frontier_exploration, "_sees", counted_sees)
    search = Explorer(ExplorationOptions(), Footprint()).search(islands(), Pose2(x_m=0.8, y_m=0.8))
    most, total, done = dict(work), dict(work), False
    while not done:
        work.update(dict.fromkeys(work, 0))
        done = next(search, "ended") == "ended"
        for kind, amount in work.items():
            most[kind], total[kind] = max(most[kind], amount), total[kind] + amount
    assert total["inflated"] > 1200 * 1200
    assert most["inflated"] <= 1.3 * BAND_CELLS  # with the rows round a band
    assert most["expanded"] <= DIJKSTRA_CELLS
    assert total["sights"] >= 400
    assert most["sights"] <= frontier_exploration.STEPS_PER_SLICE
