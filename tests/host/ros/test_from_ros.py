"""Messages whose numbers no page can show are refused."""

import math

import numpy as np
import pytest

from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.ros.from_ros import grid_of
from thumper.ros.to_ros import Messages


@pytest.mark.parametrize("resolution_m", [0.0, -0.05, math.inf, math.nan])
def test_a_grid_of_impossible_resolution_is_refused(resolution_m: float) -> None:
    """An infinite one froze every page: JSON has no infinity."""
    grid = OccupancyGrid(cells=np.zeros((2, 3), np.int8), resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    message = Messages(epoch_ns=0).grid(0.0, grid)
    assert grid_of(message).resolution_m == 0.05
    message.info.resolution = resolution_m
    with pytest.raises(ValueError, match="cells of"):
        grid_of(message)
