"""The maps of all particles: tables that grow with the known world, over one pool of shared patches."""

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.deskew import ScanPoints
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.particle_filter.patch_inserter import distance_stencil, integrate_all, quantised_distances
from thumper.slam.particle_filter.patches import (
    FAR,
    SIDE,
    IndexArray,
    empty_pool,
    grow,
    render,
    render_states,
    share,
)

FIRST_PATCHES = 256
SPARE = 256  # patches more than are needed, so that the pool does not grow at each scan
APART = 0.25  # cells by which free space may be misplaced; hits never are


class ParticleMaps:
    """Counts and distances of `particles` maps, on one lattice fixed to the map frame."""

    def __init__(
        self,
        particles: int,
        resolution_m: float,
        reach_m: float,
        occupied_fraction: float,
        cleared_beams: int,
    ) -> None:
        """Start without cells.

        Free space is cleared along about `cleared_beams` beams a scan, other ones in each scan.
        """
        self._cleared_beams = cleared_beams
        self.resolution_m = resolution_m
        self.reach = max(1, min(SIDE - 1, round(reach_m / resolution_m)))
        self.levels_per_cell = 254.0 / self.reach
        self.pool = empty_pool(FIRST_PATCHES)
        self.tables: IndexArray = np.zeros((particles, 0, 0), dtype=np.int32)
        self._occupied_fraction = occupied_fraction
        self._levels, self._stencil = quantised_distances(self.reach), distance_stencil(self.reach)
        self._first_row = self._first_col = 0
        self._layer = np.zeros((0, 0), dtype=np.uint8)  # scratch, a byte a cell of the tables
        self._turn = 0
        self._shown: tuple[int, OccupancyGrid] | None = None  # particle and map as last asked for

    @property
    def corner_m(self) -> FloatArray:
        """(x, y) of the corner of the tables in the map, shape (2,)."""
        return SIDE * self.resolution_m * np.array([self._first_col, self._first_row], dtype=np.float64)

    def in_cells(self, poses: FloatArray) -> FloatArray:
        """Poses, shape (n, 3), with x and y in cells from the corner."""
        found = poses.copy()
        found[:, :2] = (found[:, :2] - self.corner_m) / self.resolution_m
        return found

    def in_metres(self, poses: FloatArray) -> FloatArray:
        """The inverse of `in_cells`."""
        found = poses.copy()
        found[:, :2] = found[:, :2] * self.resolution_m + self.corner_m
        return found

    def integrate(self, poses: FloatArray, points: ScanPoints) -> None:
        """Enter a scan at each particle's pose, shape (particles, 3) [m, m, rad]."""
        length_m = float(np.hypot(points.ends_m[:, 0], points.ends_m[:, 1]).max())
        length_m += (2 * self.reach + 2) * self.resolution_m
        self._cover(poses[:, :2].min(axis=0) - length_m, poses[:, :2].max(axis=0) + length_m)
        self._shown = None
        placed = self.in_cells(poses)
        order, middles = grouped(placed, length_m / self.resolution_m)
        self._turn += 1
        clear_every = max(1, round(np.count_nonzero(points.kinds) / self._cleared_beams))
        done, particles = 0, poses.shape[0]
        while done < particles:
            done, need = integrate_all(
                done,
                order,
                placed,
                middles,
                points.origins_m / self.resolution_m,
                points.ends_m / self.resolution_m,
                points.kinds,
                self._turn % clear_every,
                clear_every,
                self._layer,
                self.tables,
                self.pool,
                self._stencil,
                self._levels,
                self.reach,
                self._occupied_fraction,
            )
            if done < particles:
                grow(self.pool, need - int(self.pool.size[0]) + SPARE)

    def inherit(self, parents: IndexArray) -> None:
        """Give particle k the map of `parents[k]`; a parent must keep its own."""
        self._shown = None
        share(self.tables, parents, self.pool)

    def distance_m(self, particle: int) -> np.ndarray[tuple[int, int], np.dtype[np.float32]]:
        """One particle's distance field as a plain array, for the wide search."""
        near = render(self.tables[particle], self.pool.near, FAR)
        return near * np.float32(self.reach * self.resolution_m / 254.0)

    def grid(self, particle: int) -> OccupancyGrid:
        """One particle's map: free, occupied or unknown, no larger than the patches it knows.

        The same object until a scan is entered: the loop asks ten times a second.
        """
        if self._shown is None or self._shown[0] != particle:
            known, row, col = self._known(particle)
            x_m, y_m = self.corner_m + SIDE * self.resolution_m * np.array([col, row])
            grid = OccupancyGrid(
                cells=render_states(known, self.pool),
                resolution_m=self.resolution_m,
                origin_x_m=float(x_m),
                origin_y_m=float(y_m),
            )
            self._shown = particle, grid
        return self._shown[1]

    def counts(self, particle: int) -> HitCounts:
        """One particle's hits and misses, no more than the patches it knows."""
        known, row, col = self._known(particle)
        return HitCounts(
            hits=render(known, self.pool.hits, 0).astype(np.uint16),
            misses=render(known, self.pool.misses, 0).astype(np.uint16),
            first_cell=(SIDE * (self._first_row + row), SIDE * (self._first_col + col)),
            resolution_m=self.resolution_m,
        )

    def _known(self, particle: int) -> tuple[IndexArray, int, int]:
        """The part of its table that holds patches, and that part's first row and column."""
        table = self.tables[particle]
        rows, cols = np.flatnonzero(table.any(axis=1)), np.flatnonzero(table.any(axis=0))
        if not rows.size:
            return table[:0, :0].copy(), 0, 0
        row, col = int(rows[0]), int(cols[0])
        return np.ascontiguousarray(table[row : rows[-1] + 1, col : cols[-1] + 1]), row, col

    def _cover(self, low_m: FloatArray, high_m: FloatArray) -> None:
        """Grow the tables to hold the box."""
        patch_m = SIDE * self.resolution_m
        left, top = (int(v) for v in np.floor(low_m / patch_m))
        right, bottom = (int(v) + 1 for v in np.floor(high_m / patch_m))
        particles, rows, cols = self.tables.shape
        if rows:
            left, right = min(left, self._first_col), max(right, self._first_col + cols)
            top, bottom = min(top, self._first_row), max(bottom, self._first_row + rows)
            if (bottom - top, right - left) == (rows, cols):
                return
        tables = np.zeros((particles, bottom - top, right - left), dtype=np.int32)
        r, c = self._first_row - top, self._first_col - left
        if rows:
            tables[:, r : r + rows, c : c + cols] = self.tables
        self.tables, self._first_row, self._first_col = tables, top, left
        self._layer = np.zeros((SIDE * (bottom - top), SIDE * (right - left)), dtype=np.uint8)


def grouped(poses: FloatArray, length: float) -> tuple[IndexArray, FloatArray]:
    """Groups of poses, shape (n, 3) in cells and radians, that see nearly the same up to `length` cells away.

    Returns the order that puts each group together, shape (n,), and the middle of each pose's group, (n, 3):
    `APART` cells from the pose at most along x and y, and across at the end of the longest beam.
    """
    steps = 2.0 * APART * np.array([1.0, 1.0, 1.0 / length])
    groups = np.rint((poses - poses[0]) / steps)
    key = groups @ np.array([1.0, 2.0**17, 2.0**34])  # exact: no group is 2^16 steps away
    return np.argsort(key, kind="stable").astype(np.int32), poses[0] + groups * steps


def pose_row(pose: Pose2) -> FloatArray:
    """x, y, theta as an array, shape (3,)."""
    return np.array([pose.x_m, pose.y_m, pose.theta_rad])
