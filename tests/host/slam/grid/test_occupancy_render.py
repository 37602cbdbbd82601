"""Renders of a growing map equal a render of all its counts, and know where they differ."""

import math

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.lidar.deskew import HIT, INVALID, MISS, ScanPoints
from thumper.maps.cell_changes import REMEMBERED_RENDERS, CellBox
from thumper.maps.occupancy_grid import CellArray, OccupancyGrid
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.costmap.layers import CostmapLayers
from thumper.navigation.footprint import Footprint
from thumper.slam.grid import occupancy_render
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.grid.occupancy_render import render_occupancy
from thumper.slam.scan_matching.patch_grid import PatchGrid

NO_HITS = np.empty((0, 2))


def random_scan(rng: np.random.Generator, reach_m: float) -> ScanPoints:
    """Return beams from the robot; some hit something, some do not, some are invalid."""
    return ScanPoints(
        origins_m=np.zeros((40, 2)),
        ends_m=rng.uniform(-reach_m, reach_m, (40, 2)),
        kinds=rng.choice(np.array((HIT, HIT, MISS, INVALID), np.uint8), 40),
    )


def from_scratch(hit_grid: HitGrid) -> OccupancyGrid:
    return hit_grid.counts().grid(hit_grid.occupied_fraction)


@pytest.mark.parametrize("seed", range(6))
def test_renders_and_costmaps_equal_whole_ones(seed: int) -> None:
    """Scans come, the map grows; readers of each render, and of some, know all changed cells."""
    rng, hit_grid = np.random.default_rng(seed), HitGrid(0.05, 0.5, 0.25)
    every, some = (CostmapLayers(Footprint(), CostmapOptions()) for _ in range(2))
    held: list[tuple[OccupancyGrid, np.ndarray]] = []
    parts = 0
    for cycle in range(60):
        for _ in range(int(rng.integers(0, 3))):
            here = Pose2(x_m=float(rng.uniform(-3.0, 3.0)), y_m=float(rng.uniform(-1.0, 1.0)))
            hit_grid.insert(here, random_scan(rng, float(rng.uniform(0.2, 3.0))))
        if not hit_grid.shape[0]:
            continue
        grid = hit_grid.grid(percent=False)
        np.testing.assert_array_equal(grid.cells, from_scratch(hit_grid).cells)
        parts += held[-1:] != [] and grid.changed_since(held[-1][0].history) is not None
        held = [*held[-int(rng.integers(1, 6)) :], (grid, grid.cells.copy())]
        for older, cells in held:
            np.testing.assert_array_equal(older.cells, cells)  # what was returned does not change
        for layers in (every, some) if cycle % 7 == 0 else (every,):
            whole = build_costmap(grid, NO_HITS, Footprint(), CostmapOptions())
            costmap = layers.update(grid, NO_HITS)
            assert costmap is not None
            np.testing.assert_array_equal(costmap.costs, whole.costs)
    assert parts > 30  # the map has grown seldom: most renders knew what changed


def test_changed_box_is_that_of_the_cells_that_differ() -> None:
    rng, hit_grid = np.random.default_rng(1), HitGrid(0.05, 0.5, 0.25)
    hit_grid.insert(Pose2(), random_scan(rng, 4.0))
    grids = [hit_grid.grid(percent=False)]
    for _ in range(REMEMBERED_RENDERS + 2):
        hit_grid.insert(Pose2(), random_scan(rng, 1.0))
        grids.append(hit_grid.grid(percent=False))
    newest = grids[-1]
    for older in (grids[-2], grids[-REMEMBERED_RENDERS]):
        union = CellBox(0, 0, 0, 0)
        first = next(k for k, grid in enumerate(grids) if grid is older)
        for one, two in zip(grids[first:-1], grids[first + 1 :], strict=True):
            rows, cols = np.nonzero(one.cells != two.cells)
            if rows.size:
                new = CellBox(int(rows.min()), int(cols.min()), int(rows.max()) + 1, int(cols.max()) + 1)
                union = union.union(new)
        assert newest.changed_since(older.history) == union
    assert newest.changed_since(newest.history) == CellBox(0, 0, 0, 0)
    assert newest.changed_since(grids[0].history) is None  # too long ago
    assert grids[-2].changed_since(newest.history) is None
    other = HitGrid(0.05, 0.5, 0.25)
    other.insert(Pose2(), random_scan(rng, 1.0))
    assert newest.changed_since(other.grid(percent=False).history) is None


def test_work_and_memory_follow_the_scan_not_the_map(monkeypatch: pytest.MonkeyPatch) -> None:
    """A scan after the first renders its own cells, into the array of a grid that nobody holds."""
    rng, hit_grid = np.random.default_rng(2), HitGrid(0.05, 0.5, 0.25)
    read: list[CellBox] = []

    def counted(source: PatchGrid, fraction: float, box: CellBox, cells: CellArray) -> CellBox:
        read.append(box)
        return render_occupancy(source, fraction, box, cells)

    monkeypatch.setattr(occupancy_render, "render_occupancy", counted)
    hit_grid.insert(Pose2(), random_scan(rng, 20.0))
    hit_grid.grid(percent=False)
    arrays = set()
    for _ in range(20):
        hit_grid.insert(Pose2(), random_scan(rng, 1.0))
        arrays.add(hit_grid.grid(percent=False).cells.ctypes.data)
    assert len(arrays) == 2
    assert read[0].cells == math.prod(hit_grid.shape)
    assert max(box.cells for box in read[1:]) <= 43 * 43
