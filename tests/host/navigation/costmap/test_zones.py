"""Polygons as masks, and a drive that they turn aside, slow down or refuse while it runs."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.maps.annotations import Zone, ZoneKind
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.filters import is_kept_out, keepout_cells, speed_fractions
from thumper.navigation.costmap.zones import polygon_mask, zone_masks
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationState, Navigator
from thumper.navigation.options import NavigationOptions

Vertices = tuple[tuple[float, float], ...]
CONCAVE: Vertices = ((0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (1.5, 0.8), (0.0, 3.0))


def keepout(*vertices_m: tuple[float, float]) -> Zone:
    return Zone(name="zone", kind=ZoneKind.KEEPOUT, vertices_m=vertices_m)


def winding(polygon_m: Vertices, x_m: float, y_m: float) -> float:
    """Return the turns that a look from the point along the outline makes: 0 outside."""
    angles = [math.atan2(y - y_m, x - x_m) for x, y in polygon_m]
    turns = zip(angles, angles[1:] + angles[:1], strict=True)
    return sum(math.remainder(after - before, math.tau) for before, after in turns) / math.tau


@settings(max_examples=60, deadline=None)
@given(x_m=st.floats(-1.0, 4.0), y_m=st.floats(-1.0, 4.0), dx_m=st.floats(-20.0, 20.0))
def test_a_mask_is_its_polygon_to_a_cell(x_m: float, y_m: float, dx_m: float) -> None:
    shifted = tuple((x + dx_m, y - dx_m) for x, y in CONCAVE)
    masks = (polygon_mask(np.array(shifted), 100),)
    is_inside = abs(winding(CONCAVE, x_m, y_m)) > 0.5
    ends = zip(CONCAVE, CONCAVE[1:] + CONCAVE[:1], strict=True)
    edge_m = min(distance_to(start, end, x_m, y_m) for start, end in ends)
    if edge_m > 0.05 * math.sqrt(2.0):
        assert is_kept_out(masks, x_m + dx_m, y_m - dx_m) == is_inside


def distance_to(start: tuple[float, float], end: tuple[float, float], x_m: float, y_m: float) -> float:
    (sx, sy), (ex, ey) = start, end
    share = ((x_m - sx) * (ex - sx) + (y_m - sy) * (ey - sy)) / ((ex - sx) ** 2 + (ey - sy) ** 2)
    share = min(1.0, max(0.0, share))
    return math.hypot(sx + share * (ex - sx) - x_m, sy + share * (ey - sy) - y_m)


def test_a_zone_narrower_than_a_cell_has_no_gap() -> None:
    mask = polygon_mask(np.array(((0.01, 0.0), (2.0, 1.3), (2.01, 1.3))), 100)
    grid = OccupancyGrid(cells=np.zeros((40, 60), np.int8), resolution_m=0.05, origin_x_m=0.02, origin_y_m=0)
    closed = keepout_cells((mask,), grid)
    assert closed[:, :38].any(axis=0).all()


def test_zones_add_up_and_the_slowest_counts() -> None:
    slow = [
        Zone(name="a", kind=ZoneKind.SLOW, vertices_m=((0, 0), (2, 0), (2, 1), (0, 1)), speed_percent=70),
        Zone(name="b", kind=ZoneKind.SLOW, vertices_m=((1, 0), (3, 0), (3, 1), (1, 1)), speed_percent=20),
    ]
    masks = zone_masks([*slow, keepout((0, 0), (1, 0), (0, 1)), keepout((5, 5), (6, 5), (5, 6))])
    places_m = np.array(((0.5, 0.5), (1.5, 0.5), (2.5, 0.5), (3.5, 0.5)))
    assert speed_fractions(masks.speed, places_m) == pytest.approx([0.7, 0.2, 0.2, 1.0])
    assert is_kept_out(masks.keepout, 0.2, 0.2)
    assert is_kept_out(masks.keepout, 5.2, 5.2)
    assert not is_kept_out(masks.keepout, 0.8, 0.8)


GRID = OccupancyGrid(cells=np.zeros((120, 120), np.int8), resolution_m=0.05, origin_x_m=-1.0, origin_y_m=-3.0)
WALL = keepout((1.0, -3.5), (1.2, -3.5), (1.2, 1.0), (1.0, 1.0))


def test_a_zone_drawn_while_driving_moves_the_path_at_once() -> None:
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.set_goal(Goal(x_m=2.5, y_m=0.0))
    paths = []
    for cycle in range(4):
        if cycle == 2:
            navigator.set_filters(zone_masks([WALL]))
        output = navigator.update(0.1 * cycle, Pose2(), Twist2(), GRID, np.empty((0, 2)))
        paths.append(output.plan)
    crossing = [is_kept_out(zone_masks([WALL]).keepout, *point) for point in paths[1]]
    assert any(crossing)
    assert not any(is_kept_out(navigator.keepout, *point) for point in paths[2])
    assert paths[2][:, 1].max() > 1.0  # round its end
    navigator.set_filters(zone_masks([keepout((2.0, -1.0), (3.0, -1.0), (3.0, 1.0), (2.0, 1.0))]))
    output = navigator.update(0.5, Pose2(), Twist2(), GRID, np.empty((0, 2)))
    assert output.state is NavigationState.FAILED
    assert output.reason == "goal (2.50, 0.00) is in a keep-out zone: choose a goal outside it"


def test_a_goal_in_a_zone_is_refused_in_one_line() -> None:
    navigator = Navigator(NavigationOptions(), Footprint())
    navigator.validate_goal(Goal(x_m=1.1, y_m=0.0), GRID)
    navigator.set_filters(zone_masks([WALL]))
    with pytest.raises(ThumperError, match=r"goal \(1\.10, 0\.00\) is in a keep-out zone: choose a goal"):
        navigator.validate_goal(Goal(x_m=1.1, y_m=0.0), GRID)
    with pytest.raises(ThumperError, match="too near an obstacle or a keep-out zone"):
        navigator.validate_goal(Goal(x_m=0.95, y_m=0.0, tolerance_m=0.02), GRID)
    navigator.set_filters(zone_masks([]))
    navigator.validate_goal(Goal(x_m=1.1, y_m=0.0), GRID)
