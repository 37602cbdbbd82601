"""navfn, lattice and carrot: against the recorded navfn, against each other, and their reasons."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.host.navigation.planners.test_astar import START, costmap_of, room_with_wall
from thumper.common.geometry import FloatArray, Pose2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.costmap.footprint_collision import CollisionGrid, lethal_count
from thumper.navigation.costmap.inflation import UNKNOWN
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.astar import AStarPlanner, is_blocked
from thumper.navigation.planners.carrot import CarrotPlanner
from thumper.navigation.planners.cell_costs import CellCosts
from thumper.navigation.planners.dijkstra import dijkstra
from thumper.navigation.planners.lattice import LatticeOptions, LatticePlanner
from thumper.navigation.planners.navfn import NavfnPlanner
from thumper.navigation.planners.planner import Planner
from thumper.navigation.planners.polyline import arc_lengths, project_onto
from thumper.navigation.planners.replanning import PathManager, ReplanningOptions
from thumper.navigation.planners.traversal_cost import TraversalCostOptions
from thumper_hil.kinematic.maps import ROS_FOOTPRINT, read_trinary

PLANNERS: dict[str, Planner] = {
    "navfn": NavfnPlanner(TraversalCostOptions()),
    "dijkstra": NavfnPlanner(TraversalCostOptions(), guided=False),
    "lattice": LatticePlanner(LatticeOptions(), TraversalCostOptions(), Footprint()),
}


@pytest.mark.parametrize("guided", [False, True])
@pytest.mark.parametrize("name", ["willow-full-0.05", "depot"])
def test_path_lengths_equal_those_of_ros_navfn(nav_data: Path, name: str, guided: bool) -> None:
    cells = read_trinary(nav_data / "ros_maps" / f"{name}.pgm")
    known = np.maximum(cells, 0).astype(np.int8)
    grid = OccupancyGrid(cells=known, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    costmap = build_costmap(
        grid, np.empty((0, 2)), ROS_FOOTPRINT, CostmapOptions(inflation_radius_m=0.55, decay_per_m=10.0)
    )
    # There an inflated cost replaces "unknown", so paths may cross unknown space near obstacles.
    costmap.costs[(cells < 0) & (costmap.costs == 0)] = UNKNOWN
    planner = NavfnPlanner(TraversalCostOptions(allow_unknown=False), guided=guided)
    ratios = []
    for x0, y0, x1, y1, navfn_m, _ in np.loadtxt(
        nav_data / "bench" / f"{name}_pairs.csv", delimiter=",", skiprows=1
    ):
        start = Pose2(x_m=0.05 * (x0 + 0.5), y_m=0.05 * (y0 + 0.5))
        path_m = planner.plan(costmap, start, Goal(x_m=0.05 * (x1 + 0.5), y_m=0.05 * (y1 + 0.5))).path_m
        assert path_m is not None
        assert not is_blocked(costmap, path_m)
        ratios.append(arc_lengths(path_m)[-1] / navfn_m)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.01)
    assert np.median(ratios) == pytest.approx(1.0, abs=0.01)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10_000), size=st.integers(6, 40), density=st.floats(0, 0.45), guided=st.booleans())
def test_finds_a_path_exactly_if_there_is_one(seed: int, size: int, density: float, guided: bool) -> None:
    """Random clutter, point robot: navfn reaches what A* reaches, and no path cuts a corner."""
    rng = np.random.default_rng(seed)
    cells = np.where(rng.random((size, size)) < density, 100, 0).astype(np.int8)
    cells[1, 1] = cells[-2, -2] = 0
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    tiny = Footprint.rectangle(length_m=0.002, width_m=0.002)
    costmap = build_costmap(grid, np.empty((0, 2)), tiny, CostmapOptions())
    start, goal = Pose2(x_m=0.075, y_m=0.075), Goal(x_m=0.05 * size - 0.075, y_m=0.05 * size - 0.075)
    ours = NavfnPlanner(TraversalCostOptions(), guided=guided).plan(costmap, start, goal)
    theirs = AStarPlanner(TraversalCostOptions(obstacle_weight=4.032)).plan(costmap, start, goal)
    assert (ours.path_m is None) == (theirs.path_m is None)
    if ours.path_m is not None:
        rows, cols = costmap.cells_of(ours.path_m)
        assert (cells[rows, cols] == 0).all()
        assert np.hypot(*np.diff(ours.path_m, axis=0).T).max() < 0.12  # from the start cell to a neighbour
        assert ours.reason or ours.path_m[-1] == pytest.approx((goal.x_m, goal.y_m))


def test_potential_in_free_space_is_the_distance() -> None:
    free = CellCosts(np.zeros((103, 103), np.uint8), np.ones(256, np.float32))
    potential = dijkstra(free, 51 * 103 + 51, -1, False, 0.0).reshape(103, 103)
    rows, cols = np.mgrid[0:103, 0:103]
    exact = np.hypot(rows - 51, cols - 51)
    inner = np.isfinite(potential) & (exact > 0)
    assert inner.sum() == 101 * 101 - 1
    error = potential[inner] - exact[inner]
    assert error.min() > -1e-3
    assert error.max() < 1.6  # first order: it grows with the logarithm of the distance


def test_path_may_be_far_longer_than_the_map_is_wide() -> None:
    """A comb of walls; ROS's navfn ends a path at four map widths."""
    cells = np.zeros((400, 80), np.int8)
    for k, row in enumerate(range(10, 390, 10)):
        cells[row, 12 * (k % 2) : 68 + 12 * (k % 2)] = 100
    costmap = costmap_of(cells)
    start, goal = Pose2(x_m=2.0, y_m=0.27), Goal(x_m=2.0, y_m=19.7)
    for planner in (PLANNERS["navfn"], PLANNERS["dijkstra"]):
        path_m = planner.plan(costmap, start, goal).path_m
        assert path_m is not None
        assert arc_lengths(path_m)[-1] > 4.0 * 80 * 0.05


@pytest.mark.parametrize("name", PLANNERS)
def test_reasons_without_a_path(name: str) -> None:
    planner = PLANNERS[name]
    cells = room_with_wall()
    assert planner.plan(costmap_of(cells), START, Goal(x_m=4.0, y_m=1.0)).path_m is not None
    assert "outside the map" in planner.plan(costmap_of(cells), START, Goal(x_m=9.0, y_m=1.0)).reason
    assert "obstacle" in planner.plan(costmap_of(cells), START, Goal(x_m=2.52, y_m=1.0)).reason
    near = planner.plan(costmap_of(cells), START, Goal(x_m=2.52, y_m=1.0, tolerance_m=0.3))
    assert near.path_m is not None
    assert "instead" in near.reason
    assert math.dist(near.path_m[-1], (2.52, 1.0)) <= 0.3
    cells[72:88, 50] = 100
    closed = planner.plan(costmap_of(cells), START, Goal(x_m=4.0, y_m=1.0))
    assert closed.path_m is None
    assert "shut off by obstacles" in closed.reason
    beside = planner.plan(costmap_of(cells), Pose2(x_m=2.45, y_m=1.0), Goal(x_m=1.0, y_m=1.0))
    assert beside.path_m is not None
    assert beside.path_m[0] == pytest.approx((2.45, 1.0))


@pytest.mark.parametrize(
    "planner", [*PLANNERS.values(), AStarPlanner(TraversalCostOptions()), CarrotPlanner(Footprint())]
)
@pytest.mark.parametrize("away_m", [0.0, 0.004, 0.02, 0.06])
def test_path_has_two_points_even_in_the_goals_own_cell(planner: Planner, away_m: float) -> None:
    """Without them, Trajectory Rollout with navfn stops short of the goal."""
    costmap = costmap_of(np.zeros((60, 60), dtype=np.int8))
    goal = Goal(x_m=START.x_m + away_m, y_m=START.y_m)
    path_m = planner.plan(costmap, START, goal).path_m
    assert path_m is not None
    assert len(path_m) >= 2
    assert path_m[0] == pytest.approx((START.x_m, START.y_m), abs=0.001)
    manager = PathManager(planner, ReplanningOptions(), Footprint())
    manager.update(0.0, costmap, START, goal)
    assert manager.remaining_m(START) == pytest.approx(away_m, abs=0.051)


def test_unknown_ground_only_when_allowed() -> None:
    cells = np.zeros((100, 100), np.int8)
    cells[:, 40:60] = -1
    goal = Goal(x_m=4.0, y_m=1.0)
    assert NavfnPlanner(TraversalCostOptions()).plan(costmap_of(cells), START, goal).path_m is not None
    closed = NavfnPlanner(TraversalCostOptions(allow_unknown=False))
    assert closed.plan(costmap_of(cells), START, goal).path_m is None
    closed_lattice = LatticePlanner(LatticeOptions(), TraversalCostOptions(allow_unknown=False), Footprint())
    assert closed_lattice.plan(costmap_of(cells), START, goal).path_m is None


def outline_hits(cells: NDArray[np.int8], path_m: FloatArray) -> int:
    """Return the highest number of outline points on obstacles along the path."""
    grid = CollisionGrid.from_costmap(costmap_of(cells), Footprint())
    steps = np.diff(path_m, axis=0)
    return max(
        lethal_count(grid, False, float(x_m), float(y_m), math.atan2(dy_m, dx_m))
        for (x_m, y_m), (dx_m, dy_m) in zip(path_m, steps, strict=False)
    )


def test_lattice_path_leaves_room_for_the_outline() -> None:
    """A dog-leg 0.45 m wide: the inscribed circle cuts its corners, the outline must not."""
    cells = np.full((80, 80), 100, np.int8)
    cells[8:17, 4:50] = 0
    cells[8:60, 41:52] = 0
    cells[49:60, 41:76] = 0
    path_m = (
        PLANNERS["lattice"].plan(costmap_of(cells), Pose2(x_m=0.5, y_m=0.62), Goal(x_m=3.4, y_m=2.72)).path_m
    )
    assert path_m is not None
    assert outline_hits(cells, path_m) <= 2


def test_carrot_goes_straight_and_stops_before_a_wall() -> None:
    carrot, cells = CarrotPlanner(Footprint()), room_with_wall()
    free = carrot.plan(costmap_of(cells), START, Goal(x_m=1.5, y_m=3.0))
    assert free.path_m is not None
    assert arc_lengths(free.path_m)[-1] == pytest.approx(math.hypot(0.5, 2.0))
    assert "blocked at" in carrot.plan(costmap_of(cells), START, Goal(x_m=4.0, y_m=1.0)).reason
    near = carrot.plan(costmap_of(cells), START, Goal(x_m=2.5, y_m=1.0, tolerance_m=0.4))
    assert near.path_m is not None
    assert near.path_m[-1, 0] < 2.5 - 0.21
    assert "as far as" in near.reason


def test_projection_lies_between_the_points() -> None:
    corner = np.array(((0.0, 0.0), (1.0, 0.0), (1.0, 2.0)))
    assert project_onto(corner, 0.3, 0.2) == pytest.approx((0, 0.3))
    assert project_onto(corner, -1.0, 0.0) == (0, 0.0)
    assert project_onto(corner, 1.4, 1.5) == pytest.approx((1, 1.5))
    assert project_onto(corner, 1.0, 9.0) == pytest.approx((1, 2.0))
    assert project_onto(np.zeros((2, 2)), 1.0, 0.0) == (0, 0.0)  # the robot is at the goal


def test_remaining_distance_shrinks_as_the_robot_drives() -> None:
    """It shrinks by the distance driven, wherever between the path's points the robot is."""
    manager = PathManager(AStarPlanner(TraversalCostOptions()), ReplanningOptions(), Footprint())
    costmap, goal = costmap_of(np.zeros((60, 60), np.int8)), Goal(x_m=2.5, y_m=1.525)
    left_m = []
    for step in range(30):
        pose = Pose2(x_m=0.5 + 0.013 * step, y_m=1.525)
        manager.update(0.1, costmap, pose, goal)
        left_m.append(manager.remaining_m(pose))
    assert np.diff(left_m) == pytest.approx(-0.013, abs=1e-6)
