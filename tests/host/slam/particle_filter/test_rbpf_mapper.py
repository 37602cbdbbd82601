"""The particle filter: patches, seeds, and the rooms of the single-hypothesis mapper."""

import math
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.shared.rooms import ROOM, room_scan

from tests.host.slam.grid.test_grid_mapper import driven_any, tour
from tests.variants import some_of
from thumper.common.geometry import Pose2, Twist2
from thumper.maps.occupancy_grid import OCCUPIED
from thumper.slam.factory import MappingOptions, Method, make_mapper
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.grid.options import GridMapperOptions
from thumper.slam.grid.patch_distances import RELEASE, quantized_distances
from thumper.slam.grid.patch_free_space import count_misses
from thumper.slam.particle_filter.options import RbpfOptions
from thumper.slam.particle_filter.particle_maps import SPARE_PATCHES
from thumper.slam.particle_filter.particle_patches import copy_tables, grow
from thumper.slam.particle_filter.rbpf_mapper import RbpfMapper
from thumper.slam.scan_matching.patches import COUNT_MAX, FAR, empty_pool, writable
from thumper_hil.world.world import World


def test_patches_are_copied_on_write() -> None:
    pool = empty_pool(4)
    tables = np.zeros((2, 2, 2), dtype=np.int32)
    first = writable(tables[0], 0, 1, pool)
    pool.hits[first, 3, 4] = 7
    copy_tables(tables, np.array([0, 0], dtype=np.int32), pool)
    assert tables[1, 0, 1] == first
    assert pool.references[first] == 2
    second = writable(tables[1], 0, 1, pool)
    pool.hits[second, 3, 4] = 9
    assert (pool.hits[first, 3, 4], pool.references[first], pool.references[second]) == (7, 1, 1)
    copy_tables(
        tables, np.array([1, 1], dtype=np.int32), pool
    )  # the first map is dropped, and its patch is free again
    assert pool.references[first] == 0
    assert int(pool.free_count[0]) == 3
    assert (pool.hits[0] == 0).all()


def test_grown_pool_keeps_its_patches() -> None:
    pool = empty_pool(1)
    table = np.zeros((1, 1), dtype=np.int32)
    patch = writable(table, 0, 0, pool)
    pool.misses[patch] = 5
    grow(pool, 3)
    assert int(pool.free_count[0]) == 3
    assert (pool.misses[patch] == 5).all()
    assert len(set(pool.free[:3].tolist())) == 3
    assert patch not in pool.free[:3]
    assert (pool.hits[pool.free[:3]] == 0).all()
    table[:] = 0
    assert (pool.distance[writable(table, 0, 0, pool)] == FAR).all()


def test_counting_eight_misses_at_once_equals_one_by_one() -> None:
    rng = np.random.default_rng(3)
    crossed = rng.integers(0, 2, 4096).astype(np.uint8)
    hits = np.where(rng.random(4096) < 0.3, rng.integers(0, COUNT_MAX + 1, 4096), 0).astype(np.uint8)
    misses = rng.integers(0, COUNT_MAX + 1, 4096).astype(np.uint8)
    misses[::7] = COUNT_MAX
    more = np.where(misses == COUNT_MAX, COUNT_MAX // 2, misses) + 1
    expected = np.where((crossed == 1) & (hits == 0), more, misses)
    assert count_misses(crossed.view(np.uint64), hits.view(np.uint64), misses.view(np.uint64))
    np.testing.assert_array_equal(misses, expected)
    hits[crossed == 1] = 0
    assert not count_misses(crossed.view(np.uint64), hits.view(np.uint64), misses.view(np.uint64))


def test_pool_tracks_hits_and_has_few_spare_patches() -> None:
    mapper = RbpfMapper(filter_options=RbpfOptions(particles=6))
    driven_any(mapper, slip=0.1)
    pool, used = mapper.maps.pool, np.unique(mapper.maps.tables)
    np.testing.assert_array_equal(pool.has_hits[used] != 0, pool.hits[used].any(axis=(1, 2)))
    assert 0 < np.count_nonzero(pool.has_hits[used]) < used.size - 1
    assert not mapper.maps._layer.any()
    # At most what a scan of this room may write in one map, and the step by which the pool grows.
    assert pool.references.size - used.size < 2 * SPARE_PATCHES


def test_updated_distances_equal_distances_from_the_walls() -> None:
    """The levels after a drive equal those computed from the occupied cells alone."""
    mapper = RbpfMapper(filter_options=RbpfOptions(particles=2))
    driven_any(mapper, slip=0.1)
    maps = mapper.maps
    distance_m = maps.distance_field(mapper._best).distance_m
    table = maps.tables[mapper._best]
    hits, misses = (maps._plain(table, counts).astype(int) for counts in (maps.pool.hits, maps.pool.misses))
    walls, share = distance_m == 0.0, hits / np.maximum(hits + misses, 1)
    assert np.count_nonzero(walls) > 200
    assert share[walls].min() >= RELEASE * 0.25  # a wall is released later than it is set
    assert share[~walls].max() < 0.25
    occupied = np.argwhere(walls)
    levels = quantized_distances(maps.max_distance_cells)
    for row, col in np.argwhere(distance_m < maps.max_distance_cells * 0.05 * FAR / 254)[::37]:
        squared = int(((occupied - (row, col)) ** 2).sum(axis=1).min())
        level = round(float(distance_m[row, col]) / (maps.max_distance_cells * 0.05) * 254)
        assert level == int(levels[squared])


@pytest.mark.parametrize("mapper", [RbpfMapper(filter_options=RbpfOptions(particles=2)), GridMapper()])
def test_returned_map_never_changes(mapper: RbpfMapper | GridMapper) -> None:
    driven_any(mapper, slip=0.0)
    grid = mapper.grid()
    before = grid.cells.copy()
    assert mapper.grid() is grid
    driven_any(mapper, slip=0.1)
    assert np.array_equal(grid.cells, before)
    assert not np.array_equal(mapper.grid().cells, before)


@pytest.mark.slow
@pytest.mark.parametrize("seed", some_of(range(10), 3))
def test_every_seed_follows_the_tour(seed: int) -> None:
    mapper = RbpfMapper(filter_options=RbpfOptions(particles=8, seed=seed), map_from_base=tour()[0])
    found = driven_any(mapper, slip=0.2)
    assert max(pose.distance_m(truth) for pose, truth in zip(found, tour(), strict=True)) < 0.05
    path = mapper.path()
    assert max(math.hypot(p[0] - t.x_m, p[1] - t.y_m) for p, t in zip(path, tour(), strict=True)) < 0.05


def test_same_seed_gives_the_same_map() -> None:
    maps = []
    for _ in range(2):
        mapper = RbpfMapper(filter_options=RbpfOptions(particles=5, seed=7))
        driven_any(mapper, slip=0.1)
        maps.append(mapper.grid().cells)
    np.testing.assert_array_equal(maps[0], maps[1])


def test_occupied_cells_lie_on_walls() -> None:
    mapper = RbpfMapper(GridMapperOptions(), RbpfOptions(particles=5), map_from_base=tour()[0])
    driven_any(mapper, slip=0.1)
    truth, grid = World(segments_m=ROOM, circles_m=np.zeros((0, 3))).to_grid(), mapper.grid()
    hit = 0
    cells = np.argwhere(grid.cells == OCCUPIED)
    for row, col in cells:
        r, c = truth.cell_of(*grid.centre_of(int(row), int(col)))
        hit += bool((truth.cells[r - 1 : r + 2, c - 1 : c + 2] == OCCUPIED).any())
    assert len(cells) > 200
    assert hit > 0.97 * len(cells)


def test_stationary_robot_does_not_change_the_map() -> None:
    mapper, rng = RbpfMapper(filter_options=RbpfOptions(particles=5)), np.random.default_rng(2)
    mapper.update(Pose2(), room_scan(Pose2(), noise_m=0.02, rng=rng), Twist2())
    before = mapper.grid().cells
    for _ in range(20):
        assert not mapper.update(Pose2(), room_scan(Pose2(), noise_m=0.02, rng=rng), Twist2()).integrated
    np.testing.assert_array_equal(mapper.grid().cells, before)


@pytest.mark.parametrize("method", ["slam", "scan_match", "rbpf"])
def test_odometry_counts_before_the_first_usable_scan(method: Method) -> None:
    """Nothing is mapped until there are beams, but the wheels count from the start."""
    start = Pose2(x_m=-1.0, y_m=0.5)
    mapper = make_mapper(MappingOptions(method=method), map_from_base=start)
    for k in range(10):
        step = Pose2(x_m=0.1 * k)
        scan = room_scan(start @ step)
        if k < 6:
            scan = replace(scan, ranges_m=np.full_like(scan.ranges_m, np.nan))
        update = mapper.update(step, scan, Twist2())
        assert update.map_from_base.distance_m(start @ step) < 0.05  # a cell
    np.testing.assert_allclose(mapper.path()[:, 0], start.x_m + 0.1 * np.arange(10), atol=0.05)


def test_odometry_jump_does_not_spoil_the_map() -> None:
    """Tables up to the new position would take terabytes, but a scan that does not fit is not inserted."""
    mapper = RbpfMapper()
    mapper.update(Pose2(), room_scan(Pose2()), Twist2())
    before = mapper.grid()
    update = mapper.update(Pose2(x_m=1e7, y_m=1e7), room_scan(Pose2()), Twist2())
    assert not update.integrated
    assert update.match_score < 0.3
    np.testing.assert_array_equal(mapper.grid().cells, before.cells)
    assert "off" in mapper.quality().lost
