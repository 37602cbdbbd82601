"""A grid that grows, or is large enough from the start, holds the same map."""

import math

import numpy as np
from benchmarks.shared.distances import distance_from_scratch

from thumper.common.geometry import Pose2
from thumper.lidar.deskew import HIT, ScanPoints
from thumper.slam.grid.growing_grid import GROWTH, HitGrid
from thumper.slam.scan_matching.patches import SIDE


def circle(radius_m: float) -> ScanPoints:
    angles = np.linspace(0.0, math.tau, 180)
    ends_m = radius_m * np.column_stack((np.cos(angles), np.sin(angles)))
    return ScanPoints(origins_m=np.zeros((180, 2)), ends_m=ends_m, kinds=np.full(180, HIT, np.uint8))


def driven(grid: HitGrid, way_m: float = 40.0) -> int:
    """Insert a scan every half metre; return how often the grid has grown."""
    shapes = set()
    for x_m in np.arange(0.0, way_m, 0.5):
        grid.insert(Pose2(x_m=float(x_m)), circle(6.0))
        shapes.add(grid.shape)
    return len(shapes) - 1


def test_reserved_grid_does_not_grow_and_holds_the_same_map() -> None:
    grown, reserved = HitGrid(0.05, 0.5, 0.25), HitGrid(0.05, 0.5, 0.25)
    slices = sum(1 for _ in reserved.reserve(np.array([-6.0, -6.0]), np.array([46.0, 6.0])))
    assert slices >= 2
    assert driven(grown) > 1
    assert driven(reserved) == 0
    row, col = np.round((np.array(reserved.corner_m) - grown.corner_m) / 0.05).astype(int)[::-1]
    rows, cols = reserved.shape
    for name in ("hits", "misses", "distance_m"):
        same = getattr(grown, name)[row : row + rows, col : col + cols]
        np.testing.assert_array_equal(getattr(reserved, name)[: same.shape[0], : same.shape[1]], same)
    np.testing.assert_array_equal(reserved.distance_m, distance_from_scratch(reserved))


def test_growth_is_seldom_and_proportional() -> None:
    """Each growth renders the whole map: 400 m of way may not cost 125 renders, one for each 64 cells."""
    grid = HitGrid(0.05, 0.5, 0.25)
    assert driven(grid, 400.0) < 2 + math.log(8000 / 300) / math.log(1.0 + GROWTH)


def test_memory_follows_the_ground_that_beams_have_crossed() -> None:
    """A drive along the diagonal of a square kilometre."""
    grid = HitGrid(0.05, 0.5, 0.25)
    for k_m in range(0, 1000, 4):
        grid.insert(Pose2(x_m=k_m, y_m=k_m), circle(6.0))
    assert min(grid.shape) > 20_000
    patches = np.count_nonzero(grid.cells.table)
    assert patches * SIDE**2 < 0.03 * math.prod(grid.shape)
