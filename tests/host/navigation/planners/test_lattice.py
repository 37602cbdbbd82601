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
