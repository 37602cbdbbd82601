"""A pose in front of a thing: free, known, and on the side from which the thing was seen."""

import math

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.facing_pose import facing_pose

SIDE, CELL_M = 120, 0.05  # a room of 6 m
NO_HITS = np.empty((0, 2))
FOOTPRINT = Footprint()
FRONT_M = 0.21
THING = Pose2(x_m=3.0, y_m=3.0, theta_rad=math.pi)  # seen from smaller x


def room() -> OccupancyGrid:
    """Return a free room with the thing: a square of 0.3 m behind its front."""
    cells = np.full((SIDE, SIDE), FREE, np.int8)
    cells[57:63, 60:66] = OCCUPIED
    return OccupancyGrid(cells=cells, resolution_m=CELL_M, origin_x_m=0.0, origin_y_m=0.0)


def test_the_robot_stands_before_the_thing_and_faces_it() -> None:
    pose = facing_pose(THING, room(), NO_HITS, FOOTPRINT)
    assert pose is not None
    assert (pose.x_m, pose.y_m) == pytest.approx((3.0 - FRONT_M - 0.3, 3.0))
    assert pose.theta_rad == pytest.approx(0.0)


def test_the_robot_stands_beside_an_obstacle_and_still_faces_the_thing() -> None:
    grid = room()
    grid.cells[58:62, 50:52] = OCCUPIED  # at 2.5...2.6 m
    pose = facing_pose(THING, grid, NO_HITS, FOOTPRINT)
    assert pose is not None
    assert abs(pose.y_m - 3.0) > 0.2
    assert pose.theta_rad == pytest.approx(math.atan2(3.0 - pose.y_m, 3.0 - pose.x_m))


def test_new_obstacles_count_before_they_are_in_the_map() -> None:
    hits_m = np.array([[2.55, 2.95], [2.55, 3.0], [2.55, 3.05]])
    pose = facing_pose(THING, room(), hits_m, FOOTPRINT)
    assert pose is not None
    assert np.hypot(hits_m[:, 0] - pose.x_m, hits_m[:, 1] - pose.y_m).min() > FOOTPRINT.inscribed_radius_m


@pytest.mark.parametrize("cell", [OCCUPIED, UNKNOWN])
def test_there_is_no_pose_behind_the_thing_or_in_unknown_space(cell: int) -> None:
    grid = room()
    grid.cells[:, :60] = cell  # where it was seen from
    assert facing_pose(THING, grid, NO_HITS, FOOTPRINT) is None


def test_there_is_no_pose_off_the_map() -> None:
    assert facing_pose(Pose2(x_m=50.0, y_m=-40.0), room(), NO_HITS, FOOTPRINT) is None
