"""The maps of all particles: tables that grow with the known world, over one pool of shared patches."""

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.lidar.deskew import ScanPoints
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.grid.patch_distances import RELEASE, quantized_distances
from thumper.slam.grid.ray_casting import GridBeams
from thumper.slam.particle_filter.particle_patches import copy_tables, grow, render_occupancy
from thumper.slam.particle_filter.patch_inserter import (
    PatchTables,
    PoseGroups,
    RayThinning,
    insert_into_all,
)
from thumper.slam.scan_matching.distance_field import ByteArray, DistanceField, insertion_rule
from thumper.slam.scan_matching.patch_grid import PatchGrid, grown_table, plain
from thumper.slam.scan_matching.patches import SIDE, IndexArray, empty_pool

FIRST_PATCHES = 256
SPARE_PATCHES = 256  # added beyond what is needed, so that the pool does not grow at each scan
CLEARED_BEAMS = 90  # free space is cleared along about this many beams of a scan, other ones each time
MAX_OFFSET_CELLS = 0.25  # by which free space may be misplaced; hits never are


class ParticleMaps:
    """Counts and distances of `particles` maps, on one grid fixed to the map frame."""

    def __init__(
        self, particles: int, resolution_m: float, max_distance_m: float, occupied_fraction: float
    ) -> None:
        """Start without cells. Distances are cut off at `max_distance_m`, at most 31 cells."""
        self.resolution_m = resolution_m
        self.max_distance_cells = max(1, min(SIDE - 1, round(max_distance_m / resolution_m)))
        self.levels_per_cell = 254.0 / self.max_distance_cells
        self.pool = empty_pool(FIRST_PATCHES)
        self.tables: IndexArray = np.zeros((particles, 0, 0), dtype=np.int32)
        levels = quantized_distances(self.max_distance_cells)
        self._rule = insertion_rule(levels, self.max_distance_cells, occupied_fraction, RELEASE)
        self._first_row = self._first_col = 0
        self._layer = np.zeros((0, 0), dtype=np.uint8)  # scratch, one byte per cell of the tables
        self._scans = 0
        self._rendered: tuple[int, OccupancyGrid] | None = None  # particle and map that were last returned

    @property
    def corner_m(self) -> FloatArray:
        """(x, y) of the corner of the tables in the map, shape (2,)."""
        return SIDE * self.resolution_m * np.array([self._first_col, self._first_row], dtype=np.float64)

    def to_cells(self, poses: FloatArray) -> FloatArray:
        """Return poses, shape (n, 3), with x and y in cells from the corner."""
        found = poses.copy()
        found[:, :2] = (found[:, :2] - self.corner_m) / self.resolution_m
        return found

    def to_metres(self, poses: FloatArray) -> FloatArray:
        """Invert `to_cells`."""
        found = poses.copy()
        found[:, :2] = found[:, :2] * self.resolution_m + self.corner_m
        return found

    def insert(self, poses: FloatArray, points: ScanPoints) -> None:
        """Insert a scan at each particle's pose, shape (particles, 3) [m, m, rad]."""
        length_m = float(np.hypot(points.ends_m[:, 0], points.ends_m[:, 1]).max())
        length_m += (2 * self.max_distance_cells + 2) * self.resolution_m
        self._ensure_covers(poses[:, :2].min(axis=0) - length_m, poses[:, :2].max(axis=0) + length_m)
        self._rendered = None
        groups = group_poses(self.to_cells(poses), length_m / self.resolution_m)
        beams = GridBeams(
            points.origins_m / self.resolution_m, points.ends_m / self.resolution_m, points.kinds
        )
        self._scans += 1
        every = max(1, round(np.count_nonzero(points.kinds) / CLEARED_BEAMS))
        thinning = RayThinning(start=self._scans % every, every=every)
        done, particles = 0, poses.shape[0]
        while done < particles:
            maps = PatchTables(self.tables, self.pool, self._layer)
            done, required = insert_into_all(done, groups, beams, thinning, maps, self._rule)
            if done < particles:
                grow(self.pool, required - int(self.pool.free_count[0]) + SPARE_PATCHES)

    def copy_maps(self, parents: IndexArray) -> None:
        """Copy the map of `parents[k]` to particle k; a parent must keep its own."""
        self._rendered = None
        copy_tables(self.tables, parents, self.pool)

    def distance_field(self, particle: int) -> DistanceField:
        """Return one particle's distance field as a plain array, for the window search."""
        distance = self._plain(self.tables[particle], self.pool.distance)
        distance_m = distance * np.float32(self.max_distance_cells * self.resolution_m / 254.0)
        max_distance_m = float(np.float32(self.max_distance_cells * self.resolution_m))
        return DistanceField(distance_m, self.resolution_m, max_distance_m)

    def grid(self, particle: int) -> OccupancyGrid:
        """Return one particle's map as free, occupied or unknown, no larger than its patches.

        The same object until a scan is inserted: the runtime asks for it ten times per second.
        """
        if self._rendered is None or self._rendered[0] != particle:
            table, row, col = self._used_table(particle)
            x_m, y_m = self.corner_m + SIDE * self.resolution_m * np.array([col, row])
            grid = OccupancyGrid(
                cells=render_occupancy(table, self.pool),
                resolution_m=self.resolution_m,
                origin_x_m=float(x_m),
                origin_y_m=float(y_m),
            )
            self._rendered = particle, grid
        return self._rendered[1]

    def counts(self, particle: int) -> HitCounts:
        """Return a copy of one particle's hits and misses, no larger than its patches."""
        table, row, col = self._used_table(particle)
        return HitCounts(
            hits=self._plain(table, self.pool.hits).astype(np.uint16),
            misses=self._plain(table, self.pool.misses).astype(np.uint16),
            first_cell=(SIDE * (self._first_row + row), SIDE * (self._first_col + col)),
            resolution_m=self.resolution_m,
        )

    def _plain(self, table: IndexArray, source: ByteArray) -> ByteArray:
        """Return the cells of one of the pool's arrays, shape (rows * SIDE, columns * SIDE)."""
        rows, cols = table.shape
        return plain(PatchGrid(table, self.pool, 0, 0), source, (rows * SIDE, cols * SIDE))

    def _used_table(self, particle: int) -> tuple[IndexArray, int, int]:
        """Return the part of its table that holds patches, and that part's first row and column."""
        table = self.tables[particle]
        rows, cols = np.flatnonzero(table.any(axis=1)), np.flatnonzero(table.any(axis=0))
        if not rows.size:
            return table[:0, :0].copy(), 0, 0
        row, col = int(rows[0]), int(cols[0])
        return np.ascontiguousarray(table[row : rows[-1] + 1, col : cols[-1] + 1]), row, col

    def _ensure_covers(self, low_m: FloatArray, high_m: FloatArray) -> None:
        """Grow the tables until they hold the box."""
        patch_m = SIDE * self.resolution_m
        left, top = (int(v) for v in np.floor(low_m / patch_m))
        right, bottom = (int(v) + 1 for v in np.floor(high_m / patch_m))
        rows, cols = self.tables.shape[1:]
        if rows:
            left, right = min(left, self._first_col), max(right, self._first_col + cols)
            top, bottom = min(top, self._first_row), max(bottom, self._first_row + rows)
            if (bottom - top, right - left) == (rows, cols):
                return
        r, c = self._first_row - top, self._first_col - left
        self.tables = grown_table(self.tables, (bottom - top, right - left), r, c)
        self._first_row, self._first_col = top, left
        self._layer = np.zeros((SIDE * (bottom - top), SIDE * (right - left)), dtype=np.uint8)


def group_poses(poses: FloatArray, length: float) -> PoseGroups:
    """Group poses, shape (n, 3) in cells and radians, that see nearly the same up to `length` cells away.

    A pose is at most `MAX_OFFSET_CELLS` from its group's centre along x and y, and across at the end of the
    longest beam.
    """
    steps = 2.0 * MAX_OFFSET_CELLS * np.array([1.0, 1.0, 1.0 / length])
    groups = np.rint((poses - poses[0]) / steps)
    key = groups @ np.array([1.0, 2.0**17, 2.0**34])  # exact: no group is 2^16 steps away
    order = np.argsort(key, kind="stable").astype(np.int32)
    return PoseGroups(order=order, poses=poses, centres=poses[0] + groups * steps)
