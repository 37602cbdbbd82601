"""A scan counts once in each cell, and the distances follow the counts."""

import math

import numpy as np
from benchmarks.shared.distances import squared_distances_of

from thumper.lidar.deskew import HIT, MISS
from thumper.slam.grid.patch_distances import squared_distances
from thumper.slam.grid.ray_casting import GridBeams, cast_rays
from thumper.slam.grid.scan_inserter import add_distances, insert_scan, observe, resume_counts
from thumper.slam.scan_matching import patches
from thumper.slam.scan_matching.distance_field import insertion_rule, is_occupied
from thumper.slam.scan_matching.patch_grid import PatchGrid, larger_pool, make_patches, plain
from thumper.slam.scan_matching.patches import COUNT_MAX, Pool, empty_pool

SIDE, REACH, FRACTION = 60, 5, 0.3
SHAPE = (SIDE, SIDE)
LAYER = (3 * patches.SIDE, 3 * patches.SIDE)
RULE = insertion_rule(squared_distances(REACH), REACH, FRACTION)


def distances_of(hits: np.ndarray, misses: np.ndarray) -> np.ndarray:
    """Return the squared distances of these counts, in one array."""
    occupied = (hits > 0) & (hits >= FRACTION * (hits.astype(int) + misses))
    return np.asarray(np.minimum(squared_distances_of(occupied), RULE.levels[-1]))


def in_patches(pool: Pool) -> PatchGrid:
    """Return a map that begins 7 and 11 cells inside of its first patch."""
    return PatchGrid(np.zeros((3, 3), np.int32), pool, 7, 11)


def scan(rng: np.random.Generator, beams: int = 90) -> GridBeams:
    angles = np.linspace(-math.pi, math.pi, beams)
    ranges = rng.uniform(3.0, 22.0, (beams, 1))
    origins = np.full((beams, 2), SIDE / 2) + rng.uniform(-1.0, 1.0, 2)
    ends = origins + ranges * np.column_stack((np.cos(angles), np.sin(angles)))
    return GridBeams(origins, ends, np.where(rng.random(beams) < 0.8, HIT, MISS).astype(np.uint8))


def counted_one_by_one(
    beams: GridBeams, hits: np.ndarray, misses: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return hits and misses after `observe` was called for each cell of the scan."""
    hits, misses = hits.copy(), misses.copy()
    columns, rows = np.floor(beams.ends[beams.kinds == HIT]).astype(int).T
    ended = set(zip(rows.tolist(), columns.tolist(), strict=True))
    layer = np.zeros(hits.shape, np.uint8)
    for row, col in ended:
        layer[row, col] = 1
    crossed = [(int(row), int(col)) for row, col in cast_rays(beams, 0, 1, 1, layer, (0, 0))]
    for seen, hit in ((ended, True), (crossed, False)):
        for row, col in seen:
            before = is_occupied(hits[row, col], misses[row, col], FRACTION)
            found = observe(int(hits[row, col]), int(misses[row, col]), hit, before, RULE)
            hits[row, col], misses[row, col] = found[:2]
    return hits, misses


def test_insertion_equals_one_observation_of_each_cell() -> None:
    rng = np.random.default_rng(2)
    counts = rng.choice((0, 0, 1, 3, COUNT_MAX - 1, COUNT_MAX), (2, *SHAPE)).astype(np.uint8)
    cells = in_patches(empty_pool(9, RULE.levels[-1]))
    assert make_patches(np.argwhere(counts.any(axis=0)).astype(np.int32), REACH, cells)
    resume_counts(counts[0], counts[1], (0, 0), cells, RULE)
    layer, freed, halved = np.zeros(LAYER, np.uint8), 0, 0
    for _ in range(6):
        beams = scan(rng)
        before = [plain(cells, source, SHAPE) for source in cells.pool[:3]]
        hits, misses = counted_one_by_one(beams, *before[:2])
        assert insert_scan(beams, layer, (0, 0), cells, RULE)
        assert not layer.any()
        after = [plain(cells, source, SHAPE) for source in cells.pool[:3]]
        for found, expected in zip(after, (hits, misses, distances_of(hits, misses)), strict=True):
            np.testing.assert_array_equal(found, expected)
        freed += int(np.count_nonzero((before[2] == 0) & (after[2] > 0)))
        halved += int(np.count_nonzero(misses < before[1]))
    assert freed > 10  # the scans do change states
    assert halved > 10  # and reach the counts' limit


def test_full_pool_grows_before_a_scan_counts() -> None:
    rng, pool = np.random.default_rng(3), empty_pool(1, RULE.levels[-1])
    cells, enough = in_patches(pool), in_patches(empty_pool(9, RULE.levels[-1]))
    layer, grown = np.zeros(LAYER, np.uint8), 0
    for share in (0.1, 0.4, 1.0, 1.0):
        beams = scan(rng)
        beams = beams._replace(ends=beams.origins + share * (beams.ends - beams.origins))
        while not insert_scan(beams, layer, (0, 0), cells, RULE):
            assert not layer.any()
            cells, grown = cells._replace(pool=larger_pool(cells.pool, RULE.levels[-1])), grown + 1
        assert insert_scan(beams, layer, (0, 0), enough, RULE)
    assert grown >= 2
    for found, expected in zip(cells.pool[:3], enough.pool[:3], strict=True):
        np.testing.assert_array_equal(plain(cells, found, SHAPE), plain(enough, expected, SHAPE))


def test_deferred_distances_equal_those_of_each_scan() -> None:
    rng = np.random.default_rng(4)
    at_once, deferred = (in_patches(empty_pool(400, RULE.levels[-1])) for _ in range(2))
    layer, counting = np.zeros(LAYER, np.uint8), RULE._replace(max_distance_cells=0)
    for _ in range(8):
        beams = scan(rng)
        assert insert_scan(beams, layer, (0, 0), at_once, RULE)
        assert insert_scan(beams, layer, (0, 0), deferred, counting)
    assert (plain(deferred, deferred.pool.distance, SHAPE) == RULE.levels[-1]).all()
    first, parts = 0, 0
    while first < deferred.table.size:
        first, parts = add_distances(first, 50, deferred, RULE), parts + 1
    assert parts > 2
    for found, expected in zip(deferred.pool[:3], at_once.pool[:3], strict=True):
        np.testing.assert_array_equal(plain(deferred, found, SHAPE), plain(at_once, expected, SHAPE))
    assert add_distances(0, 50, in_patches(empty_pool(9, RULE.levels[-1])), RULE) == deferred.table.size
