"""Insert a scan into the patched maps of all particles."""

import math
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.lidar.deskew import HIT
from thumper.slam.grid.patch_distances import add_obstacle, remove_obstacle
from thumper.slam.grid.patch_free_space import (
    CROSSED,
    ENDED,
    FreeSpaceMask,
    WordArray,
    clear,
    count_misses,
    free_space_mask,
    hit_and_crossed,
    neighbours,
)
from thumper.slam.grid.ray_casting import GridBeams, cast_rays
from thumper.slam.grid.scan_inserter import observe
from thumper.slam.scan_matching.distance_field import ByteArray, InsertionRule, is_occupied
from thumper.slam.scan_matching.patches import (
    COUNT_MAX,
    MASK,
    SIDE,
    SIDE_BITS,
    IndexArray,
    Pool,
    writable,
)


class PatchTables(NamedTuple):
    """The maps of all particles."""

    tables: IndexArray  # patch numbers, shape (particles, rows, columns)
    pool: Pool
    layer: ByteArray  # scratch memory, one byte per cell of the tables; zero before and after


class PoseGroups(NamedTuple):
    """The particles' poses, in cells from the tables' corner, in groups that see nearly the same."""

    order: IndexArray  # particles, group by group, shape (particles,)
    poses: FloatArray  # shape (particles, 3)
    centres: FloatArray  # centre of each particle's group, shape (particles, 3)


class RayThinning(NamedTuple):
    """The beams that clear free space: one in `every`, from number `start` on."""

    start: int
    every: int


@kernel
def _observe_cell(row: int, col: int, hit: bool, table: IndexArray, pool: Pool, rule: InsertionRule) -> None:
    """Add one observation to a cell, and update the distances if its state changes."""
    patch = writable(table, row >> SIDE_BITS, col >> SIDE_BITS, pool)
    r, c = row & MASK, col & MASK
    if hit:
        pool.has_hits[patch] = True
    before = pool.distance[patch, r, c] == 0
    hits, misses, after = observe(
        int(pool.hits[patch, r, c]), int(pool.misses[patch, r, c]), hit, before, rule
    )
    pool.hits[patch, r, c], pool.misses[patch, r, c] = hits, misses
    if after and not before:
        add_obstacle(row, col, table, pool, rule)
    elif before and not after:
        remove_obstacle(row, col, table, pool, rule)


@kernel
def _transform(points: FloatArray, pose: FloatArray, out: FloatArray) -> None:
    """Move the robot's points, shape (n, 2) in cells, to a pose in cells and radians."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for i in range(points.shape[0]):
        out[i, 0] = pose[0] + cos * points[i, 0] - sin * points[i, 1]
        out[i, 1] = pose[1] + sin * points[i, 0] + cos * points[i, 1]


@kernel
def _cells_at(points: FloatArray, pose: FloatArray, cells: IndexArray) -> None:
    """Fill in (row, column) of the cells that hold the robot's points, shape (n, 2), at a pose."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for i in range(points.shape[0]):
        cells[i, 0] = math.floor(pose[1] + sin * points[i, 0] + cos * points[i, 1])
        cells[i, 1] = math.floor(pose[0] + cos * points[i, 0] - sin * points[i, 1])


@kernel
def _required_patches(writes: IndexArray, table: IndexArray, pool: Pool) -> int:
    """Return how many of the patches, shape (n, 2), are shared and take a free patch when written."""
    n = 0
    for i in range(writes.shape[0]):
        patch = table[writes[i, 0], writes[i, 1]]
        n += patch == 0 or pool.references[patch] != 1
    return n


@kernel
def _insert_hits(
    cells: IndexArray, layer: ByteArray, table: IndexArray, pool: Pool, rule: InsertionRule
) -> None:
    """Count one hit in each of the cells, (row, column), shape (n, 2), and mark it ENDED in the layer."""
    hits, near, references = pool.hits, pool.distance, pool.references
    for i in range(cells.shape[0]):
        row, col = cells[i, 0], cells[i, 1]
        if layer[row, col] & ENDED:
            continue
        layer[row, col] |= ENDED
        patch, r, c = table[row >> SIDE_BITS, col >> SIDE_BITS], row & MASK, col & MASK
        if near[patch, r, c] == 0 and references[patch] == 1 and hits[patch, r, c] < COUNT_MAX:
            hits[patch, r, c] += 1  # stays occupied: no call, which costs more than the count
        else:
            _observe_cell(row, col, True, table, pool, rule)


@kernel
def _insert_free_space(
    mask: FreeSpaceMask, layer: ByteArray, table: IndexArray, pool: Pool, rule: InsertionRule
) -> None:
    """Count a miss in each cell that a beam crossed and in which none ended."""
    hit_words = pool.hits.reshape((-1, SIDE * SIDE)).view(np.uint64)
    miss_words = pool.misses.reshape((-1, SIDE * SIDE)).view(np.uint64)
    for i in range(mask.patches.shape[0]):
        place, words = mask.patches[i], mask.words[i]
        patch = table[place[0], place[1]]
        if patch == 0 or pool.references[patch] != 1:
            patch = writable(table, place[0], place[1], pool)
        # Patch 0, which has no hits, stands for all that have none: it stays in the fast memory.
        if count_misses(words, hit_words[patch if pool.has_hits[patch] else 0], miss_words[patch]):
            _miss_hit_cells((place[0], place[1]), words, layer, table, pool, rule)


@kernel
def _miss_hit_cells(
    place: tuple[int, int],
    crossed: WordArray,
    layer: ByteArray,
    table: IndexArray,
    pool: Pool,
    rule: InsertionRule,
) -> None:
    """Count a miss in the cells of one patch that were hit in earlier scans: their state may change.

    Only cells that a beam crossed and in which none ended count.
    """
    patch = table[place[0], place[1]]
    hits, misses, near = pool.hits[patch], pool.misses[patch], pool.distance[patch]
    hit_words = hits.reshape(SIDE * SIDE).view(np.uint64)
    for i in range(crossed.size):
        if not hit_and_crossed(crossed[i], hit_words[i]):
            continue
        r = 8 * i >> SIDE_BITS
        for c in range(8 * i & MASK, (8 * i & MASK) + 8):
            row, col = place[0] * SIDE + r, place[1] * SIDE + c
            if layer[row, col] != CROSSED or hits[r, c] == 0:
                continue
            missed = int(misses[r, c]) + 1
            # Count here what changes no cell's state: a call costs more, for its reference counting.
            if missed < COUNT_MAX and (
                near[r, c] != 0 or is_occupied(int(hits[r, c]), missed, rule.release * rule.occupied_fraction)
            ):
                misses[r, c] = missed
            else:
                _observe_cell(row, col, False, table, pool, rule)


@kernel
def insert_into_all(
    first: int,
    groups: PoseGroups,
    beams: GridBeams,
    thinning: RayThinning,
    maps: PatchTables,
    rule: InsertionRule,
) -> tuple[int, int]:
    """Insert one scan into the maps of particles `groups.order[first:]`, as far as the free patches last.

    Returns how many of `order` are done, and how many free patches the next one may need. The caller grows
    the pool and calls again.

    All lengths are in cells. Hits are inserted as seen from a particle's own pose. Free space is cleared as
    seen from its group's centre, with the same cells for the whole group: they differ by less than a cell.
    It is cleared along some of the beams only, which the caller alternates, because neighbouring beams cross
    the same cells.

    Each cell counts once per scan, a hit before beams that cross it.
    """
    tables, pool, layer = maps.tables, maps.pool, maps.layer
    hit_ends = beams.ends[beams.kinds == HIT]
    moved = GridBeams(np.empty_like(beams.origins), np.empty_like(beams.ends), beams.kinds)
    cells = np.empty(hit_ends.shape, dtype=np.int32)
    mask = free_space_mask(np.empty((0, 2), dtype=np.int32), layer)
    writes, traced = mask.patches, -1
    for done in range(first, groups.order.size):
        k = groups.order[done]
        table, centre = tables[k], groups.centres[k]
        if traced < 0 or not np.array_equal(centre, groups.centres[traced]):
            clear(mask.patches, layer)
            _transform(beams.origins, centre, moved.origins)
            _transform(beams.ends, centre, moved.ends)
            mask = free_space_mask(
                cast_rays(moved, thinning.start, thinning.every, CROSSED, layer, (0, 0)), layer
            )
            # A particle's own hits are off by a cell at most, and what is near them by less than a patch.
            _cells_at(hit_ends, centre, cells)
            writes = neighbours(mask.patches, cells, tables.shape[1], tables.shape[2])
            traced = k
        required = _required_patches(writes, table, pool)
        if pool.free_count[0] < required:
            clear(mask.patches, layer)
            return done, required
        _cells_at(hit_ends, groups.poses[k], cells)
        _insert_hits(cells, layer, table, pool, rule)
        _insert_free_space(mask, layer, table, pool, rule)
        for i in range(cells.shape[0]):
            layer[cells[i, 0], cells[i, 1]] &= CROSSED
    clear(mask.patches, layer)
    return int(groups.order.size), 0
