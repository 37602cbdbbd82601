"""A scan counts once in each cell, and the distances follow the counts."""

import copy
import math

import numpy as np

from thumper.lidar.deskew import HIT, MISS
from thumper.slam.grid.ray_casting import GridBeams, cast_rays
from thumper.slam.grid.scan_inserter import COUNT_MAX, HitCells, insert_scan, observe
from thumper.slam.scan_matching.distance_field import (
    InsertionRule,
    add_obstacle,
    insertion_rule,
    is_occupied,
    metric_distances,
)

SIDE, REACH, FRACTION = 60, 5, 0.3
RULE = insertion_rule(metric_distances(REACH, 0.05), REACH, FRACTION)


def distances_of(hits: np.ndarray, misses: np.ndarray, rule: InsertionRule) -> np.ndarray:
    distance_m = np.full(hits.shape, rule.levels[-1], np.float32)
    for row, col in np.ndindex(*hits.shape):
        if is_occupied(int(hits[row, col]), int(misses[row, col]), FRACTION):
            add_obstacle(row, col, distance_m, rule)
    return distance_m


def scan(rng: np.random.Generator, beams: int = 90) -> GridBeams:
    angles = np.linspace(-math.pi, math.pi, beams)
    ranges = rng.uniform(3.0, 22.0, (beams, 1))
    origins = np.full((beams, 2), SIDE / 2) + rng.uniform(-1.0, 1.0, 2)
    ends = origins + ranges * np.column_stack((np.cos(angles), np.sin(angles)))
    return GridBeams(origins, ends, np.where(rng.random(beams) < 0.8, HIT, MISS).astype(np.uint8))


def counted_one_by_one(beams: GridBeams, cells: HitCells) -> tuple[np.ndarray, np.ndarray]:
    """Return hits and misses after `observe` was called for each cell of the scan."""
    hits, misses = cells.hits.copy(), cells.misses.copy()
    columns, rows = np.floor(beams.ends[beams.kinds == HIT]).astype(int).T
    ended = set(zip(rows.tolist(), columns.tolist(), strict=True))
    layer = np.zeros(hits.shape, np.uint8)
    for row, col in ended:
        layer[row, col] = 1
    crossed = [(int(row), int(col)) for row, col in cast_rays(beams, 0, 1, 1, layer)]
    for seen, hit in ((ended, True), (crossed, False)):
        for row, col in seen:
            before = is_occupied(hits[row, col], misses[row, col], FRACTION)
            found = observe(int(hits[row, col]), int(misses[row, col]), hit, before, RULE)
            hits[row, col], misses[row, col] = found[:2]
    return hits, misses


def test_insertion_equals_one_observation_of_each_cell() -> None:
    rng = np.random.default_rng(2)
    counts = rng.choice((0, 0, 1, 3, COUNT_MAX - 1, COUNT_MAX), (2, SIDE, SIDE)).astype(np.uint8)
    cells = HitCells(counts[0], counts[1], distances_of(counts[0], counts[1], RULE))
    layer, freed, halved = np.zeros((SIDE, SIDE), np.uint8), 0, 0
    for _ in range(6):
        beams, before = scan(rng), copy.deepcopy(cells)
        hits, misses = counted_one_by_one(beams, before)
        insert_scan(beams, layer, cells, RULE)
        assert not layer.any()
        np.testing.assert_array_equal(cells.hits, hits)
        np.testing.assert_array_equal(cells.misses, misses)
        np.testing.assert_array_equal(cells.distance_m, distances_of(hits, misses, RULE))
        freed += int(np.count_nonzero((before.distance_m == 0) & (cells.distance_m > 0)))
        halved += int(np.count_nonzero(cells.misses < before.misses))
    assert freed > 10  # the scans do change states
    assert halved > 10  # and reach the counts' limit
