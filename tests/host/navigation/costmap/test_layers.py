"""The incremental costmap equals a full rebuild, whatever changes."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thumper.common.geometry import FloatArray
from thumper.maps.distance_transform import squared_distances
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap import layers as layers_module
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap
from thumper.navigation.costmap.filters import Masks
from thumper.navigation.costmap.inflation import LETHAL
from thumper.navigation.costmap.layers import CostmapLayers
from thumper.navigation.footprint import Footprint
from thumper_hil.kinematic.maps import ROS_FOOTPRINT, read_pgm

NO_HITS = np.empty((0, 2))
VALUES = np.array((-1, 0, 0, 0, 0, 0, 30, 59, 60, 100), np.int8)


def grid_of(cells: np.typing.NDArray[np.int8], x_m: float = 8.0) -> OccupancyGrid:
    return OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=x_m, origin_y_m=4.0)


def assert_same(ours: Costmap, rebuilt: Costmap) -> None:
    assert np.array_equal(ours.costs, rebuilt.costs)
    assert np.array_equal(ours.squared_cells, rebuilt.squared_cells)


def updated(layers: CostmapLayers, grid: OccupancyGrid, hits_m: FloatArray = NO_HITS) -> Costmap:
    """Return the complete costmap of an update."""
    costmap = layers.update(grid, hits_m)
    assert costmap is not None
    return costmap


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_updates_equal_a_full_rebuild(seed: int) -> None:
    """Cells change, hits appear, stay and disappear, masks come and go, the map grows and moves."""
    rng, footprint, options = np.random.default_rng(seed), Footprint(), CostmapOptions()
    cells = rng.choice(VALUES, (50, 70))
    masks = [grid_of(np.where(rng.random((40, 90)) < 0.02, 100, 0).astype(np.int8), x) for x in (7.5, 9.0)]
    keepout: Masks = ()
    kept = CostmapLayers(footprint, options)
    hits_m, x_m = np.empty((0, 2)), 8.0
    for cycle in range(12):
        if cycle == 6:
            cells, x_m = np.pad(cells, ((0, 3), (5, 0)), constant_values=-1), 7.75
        cells = cells.copy()
        for _ in range(int(rng.integers(0, 4))):
            cells[rng.integers(cells.shape[0]), rng.integers(cells.shape[1])] = rng.choice(VALUES)
        if cycle % 3:
            fresh_m = rng.uniform((7.0, 3.0), (13.0, 8.0), (int(rng.integers(0, 5)), 2))
            hits_m = np.vstack((hits_m[: len(hits_m) // 2], fresh_m, np.full((1, 2), np.nan)))
        if rng.random() < 0.3:
            keepout = tuple(mask for mask in masks if rng.random() < 0.5)
            kept.set_keepout(keepout)
        grid = grid_of(cells, x_m)
        assert_same(updated(kept, grid, hits_m), build_costmap(grid, hits_m, footprint, options, keepout))


def test_a_large_map_is_computed_over_several_cycles() -> None:
    rng, footprint, options = np.random.default_rng(3), Footprint(), CostmapOptions()
    kept = CostmapLayers(footprint, options)
    cells = rng.choice(np.array((-1, 0, 0, 0, 100), np.int8), (1200, 900))
    grid = grid_of(cells)
    calls = 0
    while kept.update(grid, NO_HITS) is None:
        calls += 1
    assert calls == 2  # three slices of two bands of 200,000 cells
    assert_same(updated(kept, grid), build_costmap(grid, NO_HITS, footprint, options))

    grown = grid_of(np.pad(cells, ((0, 0), (0, 200)), constant_values=-1))
    before = kept.update(grown, NO_HITS)
    assert before is not None
    assert before.costs.shape == cells.shape  # what is known goes on to be used
    for _ in range(3):
        now = updated(kept, grown)
    assert_same(now, build_costmap(grown, NO_HITS, footprint, options))


def test_updates_keep_ros_inflation(nav_data: Path) -> None:
    """The oracle's map, built in eight steps: differs from ROS in the 5 cells where ROS is not exact."""
    lethal = read_pgm(nav_data / "oracle" / "inflation_in_120.pgm") == LETHAL
    theirs = read_pgm(nav_data / "oracle" / "inflation_ros_120.pgm")
    kept = CostmapLayers(ROS_FOOTPRINT, CostmapOptions(inflation_radius_m=0.55, decay_per_m=10.0))
    cells = np.zeros((120, 120), np.int8)
    costs = updated(kept, grid_of(cells)).costs
    for rows in np.array_split(np.arange(120), 8):
        cells = cells.copy()
        cells[rows] = np.where(lethal[rows], 100, 0)
        costs = updated(kept, grid_of(cells)).costs
    assert (costs != theirs).sum() == 5


def test_cost_of_an_update_depends_on_the_change_not_the_map(monkeypatch: pytest.MonkeyPatch) -> None:
    """One new obstacle recomputes as many distances on a small map as on a large one."""
    cells_worked: list[int] = []

    def counted(lethal: np.typing.NDArray[np.bool_], reach: int) -> np.typing.NDArray[np.int32]:
        cells_worked.append(lethal.size)
        return squared_distances(lethal, reach)

    monkeypatch.setattr(layers_module, "squared_distances", counted)
    worked: dict[int, list[int]] = {}
    for side in (100, 400):
        cells_worked.clear()
        kept, cells = CostmapLayers(Footprint(), CostmapOptions()), np.zeros((side, side), np.int8)
        kept.update(grid_of(cells), np.empty((0, 2)))
        kept.update(grid_of(cells.copy()), np.empty((0, 2)))  # no change: no work
        cells = cells.copy()
        cells[50, 50] = 100
        kept.update(grid_of(cells), np.empty((0, 2)))
        worked[side] = cells_worked.copy()
    reach = 11
    assert worked == {100: [10_000, (4 * reach + 1) ** 2], 400: [160_000, (4 * reach + 1) ** 2]}
    assert Counter(map(len, worked.values())) == {2: 2}
