"""The lattice planner's poses."""

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.lattice import LatticeOptions, LatticePlanner
from thumper.navigation.planners.traversal_cost import TraversalCostOptions

LATTICE = LatticePlanner(LatticeOptions(), TraversalCostOptions(), Footprint())


def costmap_of(cells: np.typing.NDArray[np.int8]) -> Costmap:
    grid = OccupancyGrid(cells=cells, resolution_m=0.025, origin_x_m=-2.0, origin_y_m=-2.0)
    return build_costmap(grid, np.empty((0, 2)), Footprint(), CostmapOptions())


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_headings_are_continuous_to_either_side(side: float) -> None:
    """The follower turns by the difference of two headings: 15 degrees, not 345 to the other side."""
    goal = Goal(x_m=-0.1, y_m=0.8 * side)
    headings_rad = LATTICE.poses(costmap_of(np.zeros((160, 160), np.int8)), Pose2(), goal)[:, 2]
    assert np.abs(np.diff(headings_rad)).max() < 0.6
    assert side * headings_rad[-1] > 1.0


def test_a_detour_far_from_the_shortest_way_is_found_where_only_a_point_fits_through() -> None:
    """The heuristic is first known near the shortest way of a point alone."""

    def block(
        cells: np.typing.NDArray[np.int8], x_m: tuple[float, float], y_m: tuple[float, float], of: int
    ) -> None:
        (left, right), (low, high) = (tuple(round((v + 2.0) / 0.025) for v in side) for side in (x_m, y_m))
        cells[low:high, left:right] = of

    cells = np.zeros((160, 160), np.int8)
    block(cells, (0.3, 1.2), (-2.0, 1.4), 100)
    for x_m, y_m in (
        ((0.3, 0.92), (-0.17, 0.17)),
        ((0.58, 0.92), (-0.77, 0.17)),
        ((0.58, 1.2), (-0.77, -0.43)),
    ):
        block(cells, x_m, y_m, 0)  # two corners, too narrow for the robot
    planner = LatticePlanner(LatticeOptions(), TraversalCostOptions(obstacle_weight=0.0), Footprint())
    poses = planner.poses(costmap_of(cells), Pose2(), Goal(x_m=1.6, y_m=-0.6))
    assert len(poses)
    assert poses[:, 1].max() > 1.4
