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
        grid.insert(Pose2(x_m=float(x_m), y_m=0.013), circle(6.013))
        shapes.add(grid.shape)
    return len(shapes) - 1


def test_grown_grid_holds_the_map_of_its_parts() -> None:
    """Each scan in a grid of its own, added up, gives the same counts, and the distances follow them."""
    grid = HitGrid(0.05, 0.5, 0.25)
    assert driven(grid) > 1
    counts, (first_row, first_col) = grid.counts(), grid.counts().first_cell
    hits = np.zeros(grid.shape, np.int32)
    for x_m in np.arange(0.0, 40.0, 0.5):
        part = HitGrid(0.05, 0.5, 0.25)
        part.insert(Pose2(x_m=float(x_m), y_m=0.013), circle(6.013))
        row, col = part.counts().first_cell
        rows, cols = part.shape
        inside = hits[row - first_row :, col - first_col :][:rows, :cols]
        inside += part.hits[: inside.shape[0], : inside.shape[1]]
    np.testing.assert_array_equal(counts.hits, hits)
    np.testing.assert_array_equal(grid.distance_m, distance_from_scratch(grid))


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
