"""Branch-and-bound scan matching in a large window, for loop closure and global localization.

Two levels of Hess, Kohler, Rapp, Andor, "Real-time loop closure in 2D LIDAR SLAM", ICRA 2016 (eq. BBS,
algorithm 2). A map whose cells hold the maximum over a block bounds the score of every pose in that block
from above. Blocks are opened best first, until no bound exceeds the best score found. A robot cannot wait
for the whole search, so it runs in parts of bounded size.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2, wrap_angle
from thumper.common.numba_kernel import kernel
from thumper.common.resumable import Search, bands_of
from thumper.slam.scan_matching.distance_field import ByteArray, FieldArray

BLOCK = 8  # cells along a block of poses
STEP_RAD = math.radians(1.5)  # 0.13 m at 5 m: well inside the matcher's basin
# A pose this far from the best is another hypothesis, not a neighbour of it.
SEPARATION_M, SEPARATION_RAD = 1.0, 0.35

CellIndices = NDArray[np.int32]
TotalArray = NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchResult:
    """The best pose of a window, and the score of the second best."""

    pose: Pose2
    score: float  # mean likelihood of the beams there, 0...1
    runner_up: float  # the best score of any separate pose, or an upper bound of it


class PoseBlocks(NamedTuple):
    """The poses of a window, in blocks of BLOCK x BLOCK cells for each heading."""

    cells: CellIndices  # (column, row) of each point, robot in the window's corner, (headings, n, 2)
    corner: FloatArray  # of the window, in cells, shape (2,)
    angles_rad: FloatArray  # shape (headings,)
    bounds: TotalArray  # upper bound of the scores in each block, shape (headings, rows, columns)


class BestPoses(NamedTuple):
    """The best separate poses so far, best first, in cells and radians."""

    poses: FloatArray  # shape (k, 3)
    totals: FloatArray  # sums of likelihoods, -1 for none, shape (k,)
    separation: float  # cells
    separation_rad: float
    min_ratio: float  # poses below this share of the best total are not searched for


class SearchField:
    """A map prepared for many branch-and-bound searches."""

    def __init__(
        self, distance_m: FieldArray, resolution_m: float, corner_m: tuple[float, float], std_m: float
    ) -> None:
        """`distance_m` is that of a `HitGrid`; `std_m` is the width of a beam's likelihood."""
        max_distance_m = float(distance_m.max(initial=np.float32(resolution_m)))
        fine = _likelihood(distance_m, max_distance_m, std_m)
        self._set(fine, block_maximum(fine), resolution_m, corner_m)

    @classmethod
    def search(
        cls,
        distance_m: FieldArray,
        max_distance_m: float,
        resolution_m: float,
        corner_m: tuple[float, float],
        std_m: float,
    ) -> Search[Self]:
        """Return the field, one band of rows in each slice; distances are cut off at `max_distance_m`."""
        height, width = distance_m.shape
        fine = np.empty((height, width), np.uint8)
        for rows in bands_of((height, width)):
            fine[rows] = _likelihood(distance_m[rows], max_distance_m, std_m)
            yield
        coarse = _empty_coarse(height, width)
        for rows in bands_of((coarse.shape[2], width * BLOCK)):
            _fill_block_maximum(fine, coarse, rows)
            yield
        field = cls.__new__(cls)
        field._set(fine, coarse, resolution_m, corner_m)
        return field

    def _set(
        self, fine: ByteArray, coarse: ByteArray, resolution_m: float, corner_m: tuple[float, float]
    ) -> None:
        self.fine, self.coarse, self.resolution_m, self.corner_m = fine, coarse, resolution_m, corner_m


class BranchAndBoundSearch:
    """A search in progress for the best poses in a window."""

    def __init__(
        self,
        field: SearchField,
        points_m: FloatArray,
        centre: Pose2,
        window_m: float | tuple[float, float],
        window_rad: float,
        *,
        max_poses: int = 2,
        min_ratio: float = 0.7,
    ) -> None:
        """Start for points in the base frame, shape (n, 2), in a window of +- `window_m`, +- `window_rad`.

        `window_m` is one for x and y, or both. Up to `max_poses` separate poses are kept. Poses that explain
        less than `min_ratio` of the best are not searched for.
        """
        self._field = field
        n_theta = math.ceil(window_rad / STEP_RAD)
        if 2 * n_theta * STEP_RAD >= math.tau:
            n_theta = math.floor(math.pi / STEP_RAD)
        angles_rad: FloatArray = centre.theta_rad + STEP_RAD * np.arange(-n_theta, n_theta + 1.0)
        window = np.ceil(np.broadcast_to(window_m, 2) / field.resolution_m).astype(np.int64)
        cells = (np.array([centre.x_m, centre.y_m]) - field.corner_m) / field.resolution_m
        corner = cells - window
        cos, sin = np.cos(angles_rad)[:, np.newaxis], np.sin(angles_rad)[:, np.newaxis]
        x, y = points_m.T / field.resolution_m
        rotated = np.stack((cos * x - sin * y, sin * x + cos * y), axis=-1) + corner
        across, up = ((2 * window) // BLOCK + 1).tolist()
        self._blocks = PoseBlocks(
            cells=np.floor(rotated).astype(np.int32),
            corner=corner,
            angles_rad=angles_rad,
            bounds=np.zeros((len(angles_rad), up, across), dtype=np.int32),
        )
        self._headings_bounded = 0
        self._highest = 0  # flat index of the block with the highest bound so far
        self._order: NDArray[np.int64] | None = None  # blocks worth opening, best bound first
        self._blocks_opened = 0
        self._best = BestPoses(
            poses=np.tile(np.array([*cells, centre.theta_rad]), (max_poses, 1)),
            totals=np.full(max_poses, -1.0),
            separation=SEPARATION_M / field.resolution_m,
            separation_rad=SEPARATION_RAD,
            min_ratio=min_ratio,
        )

    def run(self, max_lookups: int | None) -> bool:
        """Continue the search and return whether it is finished.

        It stops after about `max_lookups` look-ups of a cell; None runs it to the end.
        """
        if self._headings_bounded < len(self._blocks.angles_rad):
            self._bound_headings(max_lookups)
            if max_lookups is not None:
                return False
        if self._order is None:
            self._order = self._order_blocks()
            if max_lookups is not None:
                return False
        n = self._blocks.cells.shape[1]
        count = len(self._order) if max_lookups is None else max(1, max_lookups // (n * BLOCK * BLOCK))
        last = min(len(self._order), self._blocks_opened + count)
        self._blocks_opened = self._open(self._order, self._blocks_opened, last)
        return self._blocks_opened == len(self._order)

    def _bound_headings(self, max_lookups: int | None) -> None:
        """Compute the bounds of the next headings."""
        n, (headings, up, across) = self._blocks.cells.shape[1], self._blocks.bounds.shape
        count = headings if max_lookups is None else max(1, max_lookups // (n * up * across))
        last = min(headings, self._headings_bounded + count)
        first, self._headings_bounded = self._headings_bounded, last
        _bound(self._blocks, first, last, self._field.coarse)
        new = self._blocks.bounds[first:last]
        if new.max() > self._blocks.bounds.flat[self._highest]:
            self._highest = first * up * across + int(np.argmax(new))

    def _order_blocks(self) -> NDArray[np.int64]:
        """Open the most promising block first: then most of the others need not even be sorted."""
        bounds = self._blocks.bounds
        self._open(np.array([self._highest]), 0, 1)
        least = np.int32(math.ceil(self._best.min_ratio * self._best.totals[0]))  # comparing floats is slower
        worth = np.flatnonzero(bounds >= least)
        return worth[np.argsort(-bounds.ravel()[worth], kind="stable")]

    def _open(self, order: NDArray[np.int64], first: int, last: int) -> int:
        return open_blocks(order, first, last, self._blocks, self._field.fine, self._best)

    @property
    def lookups(self) -> int:
        """Look-ups of a cell that bound all blocks: nearly all the work of the search."""
        return int(self._blocks.cells.shape[1] * self._blocks.bounds.size)

    def result(self) -> SearchResult:
        """Return the best pose and the score of the second."""
        poses, scores = self._poses_and_scores()
        x_m, y_m, theta_rad = (float(value) for value in poses[0])
        return SearchResult(
            pose=Pose2(x_m=x_m, y_m=y_m, theta_rad=wrap_angle(theta_rad)),
            score=float(scores[0]),
            runner_up=float(scores[1]),
        )

    def similar_poses(self) -> FloatArray:
        """Return all poses that explain `min_ratio` as much as the best, shape (1...max_poses, 3)."""
        poses, scores = self._poses_and_scores()
        return poses[: max(1, int(np.count_nonzero(scores >= self._best.min_ratio * scores[0])))]

    def _poses_and_scores(self) -> tuple[FloatArray, FloatArray]:
        """Return poses in the map, shape (max_poses, 3), and their scores, the best first."""
        poses = self._best.poses.copy()
        poses[:, :2] = poses[:, :2] * self._field.resolution_m + np.array(self._field.corner_m)
        return poses, np.maximum(self._best.totals, 0.0) / (255.0 * self._blocks.cells.shape[1])


@kernel
def _likelihood(distance_m: FieldArray, max_distance_m: float, std_m: float) -> ByteArray:
    """Return the likelihood of a beam that ends in each cell, 0...255; 0 from `max_distance_m` on."""
    likelihood = np.zeros(distance_m.shape, dtype=np.uint8)
    for row in range(distance_m.shape[0]):
        for col in range(distance_m.shape[1]):
            if distance_m[row, col] < max_distance_m:
                likelihood[row, col] = int(255.0 * math.exp(-0.5 * (distance_m[row, col] / std_m) ** 2))
    return likelihood


def block_maximum(fine: ByteArray) -> ByteArray:
    """Return the maximum over the BLOCK x BLOCK cells that start at each cell (Hess 2016, M_precomp).

    Blocks may start below and left of the map: cell (r, c) of the map has indices r + BLOCK, c + BLOCK. Every
    BLOCKth row and column are stored side by side, as blocks are looked up: indices (row, column) are at
    [row % BLOCK, column % BLOCK, row // BLOCK, column // BLOCK].
    """
    coarse = _empty_coarse(*fine.shape)
    _fill_block_maximum(fine, coarse, slice(0, coarse.shape[2]))
    return coarse


def _empty_coarse(height: int, width: int) -> ByteArray:
    rows, cols = (math.ceil((side + BLOCK) / BLOCK) for side in (height, width))
    return np.empty((BLOCK, BLOCK, rows, cols), np.uint8)


def _fill_block_maximum(fine: ByteArray, coarse: ByteArray, rows: slice) -> None:
    """Fill `coarse[:, :, rows]`."""
    count, cols = rows.stop - rows.start, coarse.shape[3]
    best = np.zeros((count * BLOCK + BLOCK - 1, cols * BLOCK + BLOCK - 1), dtype=np.uint8)
    first = (rows.start - 1) * BLOCK  # row of the map at index 0
    known = fine[max(0, first) : first + best.shape[0]]
    top = max(0, -first)
    best[top : top + known.shape[0], BLOCK : BLOCK + fine.shape[1]] = known
    step = 1
    while step < BLOCK:
        best = np.maximum(best[:-step], best[step:])
        best = np.maximum(best[:, :-step], best[:, step:])
        step *= 2
    coarse[:, :, rows] = best.reshape(count, BLOCK, cols, BLOCK).transpose(1, 3, 0, 2)


@kernel
def _bound(blocks: PoseBlocks, first: int, last: int, coarse: ByteArray) -> None:
    """Fill the upper bounds of headings `first` to `last`."""
    cells, bounds = blocks.cells, blocks.bounds
    (_, up, across), rows, cols = bounds.shape, coarse.shape[2], coarse.shape[3]
    for k in range(first, last):
        for i in range(cells.shape[1]):
            row, col = cells[k, i, 1] + BLOCK, cells[k, i, 0] + BLOCK
            top, left = row // BLOCK, col // BLOCK
            best, begin, end = coarse[row % BLOCK, col % BLOCK], max(0, -left), min(across, cols - left)
            for by in range(max(0, -top), min(up, rows - top)):
                into, add = bounds[k, by, begin:end], best[top + by, left + begin : left + end]
                for bx in range(into.size):  # slices from 0 on: the compiler vectorizes the loop
                    into[bx] += add[bx]


@kernel
def open_blocks(
    order: NDArray[np.int64], first: int, last: int, blocks: PoseBlocks, fine: ByteArray, best: BestPoses
) -> int:
    """Score every pose of blocks `order[first:last]`; return how many are done, all if no more can win."""
    cells, bounds, totals = blocks.cells, blocks.bounds, best.totals
    (_, up, across), (rows, cols) = bounds.shape, fine.shape
    total = np.empty((BLOCK, BLOCK), dtype=np.int32)
    pose = np.empty(3)
    for at in range(first, last):
        index = order[at]
        k, by, bx = index // (up * across), (index // across) % up, index % across
        if bounds[k, by, bx] <= totals[-1] or bounds[k, by, bx] < best.min_ratio * totals[0]:
            return order.size
        total[:] = 0
        for i in range(cells.shape[1]):
            row, col = cells[k, i, 1] + by * BLOCK, cells[k, i, 0] + bx * BLOCK
            if 0 <= row <= rows - BLOCK and 0 <= col <= cols - BLOCK:
                block = fine[row : row + BLOCK, col : col + BLOCK]
                for dy in range(BLOCK):  # fixed bounds: the compiler vectorizes the loop
                    for dx in range(BLOCK):
                        total[dy, dx] += block[dy, dx]
                continue
            for dy in range(max(0, -row), min(BLOCK, rows - row)):
                for dx in range(max(0, -col), min(BLOCK, cols - col)):
                    total[dy, dx] += fine[row + dy, col + dx]
        highest = int(np.argmax(total))
        dy, dx = highest // BLOCK, highest % BLOCK
        pose[0] = blocks.corner[0] + bx * BLOCK + dx
        pose[1] = blocks.corner[1] + by * BLOCK + dy
        pose[2] = blocks.angles_rad[k]
        _insert_pose(pose, float(total[dy, dx]), best)
    return last


@kernel
def _insert_pose(pose: FloatArray, total: float, best: BestPoses) -> None:
    """Insert a pose into the sorted list, unless a better neighbour is in it; remove worse neighbours."""
    capacity = best.totals.shape[0]
    kept, keep_poses, keep_totals = 0, best.poses.copy(), best.totals.copy()
    placed = False
    for j in range(capacity):
        if best.totals[j] < 0.0:
            break
        if not placed and total > best.totals[j]:
            keep_poses[kept], keep_totals[kept] = pose, total
            kept += 1
            placed = True
        if _are_neighbours(pose, best.poses[j], best):
            if not placed:
                return
        elif kept < capacity:
            keep_poses[kept], keep_totals[kept] = best.poses[j], best.totals[j]
            kept += 1
    if not placed and kept < capacity:
        keep_poses[kept], keep_totals[kept] = pose, total
        kept += 1
    keep_totals[kept:] = -1.0
    best.poses[:], best.totals[:] = keep_poses, keep_totals


@kernel
def _are_neighbours(pose: FloatArray, other: FloatArray, best: BestPoses) -> bool:
    distance = math.hypot(pose[0] - other[0], pose[1] - other[1])
    turn_rad = abs((pose[2] - other[2] + math.pi) % (2.0 * math.pi) - math.pi)
    return distance <= best.separation and turn_rad <= best.separation_rad
