"""Correlative search of a large window by branch and bound, for loops, relocalisation and kidnapped robots.

Two levels of Hess, Kohler, Rapp, Andor, "Real-time loop closure in 2D LIDAR SLAM", ICRA 2016: a map whose
cells hold the best of a block bounds every pose of that block from above; blocks are opened best first until
no bound beats what was found. A robot cannot wait for all of that: it is done in parts of bounded size.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2, wrap_angle
from thumper.common.numba_kernel import kernel
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.scan_matching.distance_field import ByteArray, FieldArray

BLOCK = 8  # cells along a block of poses
STEP_RAD = math.radians(1.5)  # 0.13 m at 5 m: well inside the matcher's basin
APART_M, APART_RAD = 1.0, 0.35  # a rival this far away is another place, not a neighbour of the best

CellIndices = NDArray[np.int32]
TotalArray = NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchResult:
    """The best pose of a window and how far it stands out."""

    pose: Pose2
    score: float  # mean likelihood of the beams there, 0...1
    rival: float  # the best score of any place clearly apart, or its upper bound


class SearchField:
    """A map made ready for many wide searches."""

    def __init__(
        self, distance_m: FieldArray, resolution_m: float, corner_m: tuple[float, float], std_m: float
    ) -> None:
        """`distance_m` as in `HitGrid`; `std_m` is the width of a beam's likelihood."""
        self.resolution_m, self.corner_m = resolution_m, corner_m
        far_m = float(distance_m.max(initial=np.float32(resolution_m)))
        self.fine = _likelihood(distance_m, far_m, std_m)
        self.coarse = block_maximum(self.fine)

    @classmethod
    def of(cls, cells: HitGrid, std_m: float) -> "SearchField":
        """The field of a map in the making."""
        return cls(cells.distance_m, cells.resolution_m, cells.corner_m, std_m)

    def search_all(
        self, points_m: FloatArray, centre: Pose2, window_m: float, window_rad: float, most: int, ratio: float
    ) -> FloatArray:
        """The best pose and those clearly apart that explain `ratio` as much, shape (1...most, 3)."""
        search = BranchAndBoundSearch(self, points_m, centre, window_m, window_rad, most, ratio)
        search.work(None)
        return search.alike()


class BranchAndBoundSearch:
    """A search under way: the best poses within +- window of `centre`."""

    def __init__(
        self,
        field: SearchField,
        points_m: FloatArray,
        centre: Pose2,
        window_m: float,
        window_rad: float,
        most: int = 2,
        ratio: float = 0.7,
    ) -> None:
        """Begin for points in the base frame, shape (n, 2).

        `most` poses clearly apart are kept; those that explain less than `ratio` of the best are not looked
        for.
        """
        self._field, self._most, self._ratio = field, most, ratio
        n_theta = math.ceil(window_rad / STEP_RAD)
        if 2 * n_theta * STEP_RAD >= math.tau:
            n_theta = math.floor(math.pi / STEP_RAD)
        self._angles_rad: FloatArray = centre.theta_rad + STEP_RAD * np.arange(-n_theta, n_theta + 1.0)
        window = math.ceil(window_m / field.resolution_m)
        cells = (np.array([centre.x_m, centre.y_m]) - field.corner_m) / field.resolution_m
        self._corner = cells - window  # of the window, in cells
        cos, sin = np.cos(self._angles_rad)[:, np.newaxis], np.sin(self._angles_rad)[:, np.newaxis]
        x, y = points_m.T / field.resolution_m
        turned = np.stack((cos * x - sin * y, sin * x + cos * y), axis=-1) + self._corner
        self._cells: CellIndices = np.floor(turned).astype(np.int32)  # with the robot in the corner
        blocks = (2 * window) // BLOCK + 1
        self._bounds: TotalArray = np.zeros((len(self._angles_rad), blocks, blocks), dtype=np.int32)
        self._bounded = 0  # turns
        self._order: NDArray[np.int64] | None = None
        self._opened = 0  # blocks
        self._poses, self._totals = np.empty((most, 3)), np.full(most, -1.0)
        self._poses[:] = (*cells, centre.theta_rad)

    def work(self, most: int | None) -> bool:
        """Do all that is left, or not many more than `most` look-ups of a cell; whether it is done."""
        n, (turns, blocks, _) = self._cells.shape[1], self._bounds.shape
        if self._bounded < turns:
            at_once = turns if most is None else max(1, most // (n * blocks * blocks))
            last = min(turns, self._bounded + at_once)
            _bound(self._cells, self._bounded, last, self._field.coarse, self._bounds)
            self._bounded = last
            if most is not None:
                return False
        if self._order is None:
            # With the most promising block opened most of the others need not even be sorted.
            self._open(np.array([np.argmax(self._bounds)]), 0, 1)
            worth = np.flatnonzero(self._bounds >= self._ratio * self._totals[0])
            self._order = worth[np.argsort(-self._bounds.ravel()[worth], kind="stable")]
        at_once = len(self._order) if most is None else max(1, most // (n * BLOCK * BLOCK))
        last = min(len(self._order), self._opened + at_once)
        self._opened = self._open(self._order, self._opened, last)
        return self._opened == len(self._order)

    def _open(self, order: NDArray[np.int64], first: int, last: int) -> int:
        return open_blocks(
            order, first, last, self._ratio, self._cells, self._corner, self._angles_rad, self._bounds,
            self._field.fine, APART_M / self._field.resolution_m, APART_RAD, self._poses, self._totals,
        )  # fmt: skip

    def found(self) -> SearchResult:
        """The best pose, and the score of the second."""
        poses, scores = self._result()
        x_m, y_m, theta_rad = (float(value) for value in poses[0])
        return SearchResult(
            pose=Pose2(x_m=x_m, y_m=y_m, theta_rad=wrap_angle(theta_rad)),
            score=float(scores[0]),
            rival=float(scores[1]),
        )

    def alike(self) -> FloatArray:
        """All poses that explain `ratio` as much as the best, shape (1...most, 3)."""
        poses, scores = self._result()
        return poses[: max(1, int(np.count_nonzero(scores >= self._ratio * scores[0])))]

    def _result(self) -> tuple[FloatArray, FloatArray]:
        """Poses in the map, shape (most, 3), and their scores, the best first."""
        poses = self._poses.copy()
        poses[:, :2] = poses[:, :2] * self._field.resolution_m + np.array(self._field.corner_m)
        return poses, np.maximum(self._totals, 0.0) / (255.0 * self._cells.shape[1])


@kernel
def _likelihood(distance_m: FieldArray, far_m: float, std_m: float) -> ByteArray:
    """Likelihood of a beam that ends in each cell, 0...255; 0 from `far_m` on."""
    likelihood = np.zeros(distance_m.shape, dtype=np.uint8)
    for row in range(distance_m.shape[0]):
        for col in range(distance_m.shape[1]):
            if distance_m[row, col] < far_m:
                likelihood[row, col] = int(255.0 * math.exp(-0.5 * (distance_m[row, col] / std_m) ** 2))
    return likelihood


def block_maximum(fine: ByteArray) -> ByteArray:
    """Best of the BLOCK x BLOCK cells from each cell on, itself the lowest corner.

    Blocks may begin below and left of the map: cell (r, c) of the map has indices r + BLOCK, c + BLOCK. Every
    BLOCKth row and column lie side by side, as blocks are looked up: indices row, column are at
    [row % BLOCK, column % BLOCK, row // BLOCK, column // BLOCK].
    """
    rows, cols = (math.ceil((side + BLOCK) / BLOCK) for side in fine.shape)
    best = np.zeros((rows * BLOCK + BLOCK - 1, cols * BLOCK + BLOCK - 1), dtype=np.uint8)
    best[BLOCK : BLOCK + fine.shape[0], BLOCK : BLOCK + fine.shape[1]] = fine
    step = 1
    while step < BLOCK:
        best = np.maximum(best[:-step], best[step:])
        best = np.maximum(best[:, :-step], best[:, step:])
        step *= 2
    return np.ascontiguousarray(best.reshape(rows, BLOCK, cols, BLOCK).transpose(1, 3, 0, 2))


@kernel
def _bound(
    cells: CellIndices,
    first: int,
    last: int,
    coarse: ByteArray,
    bounds: TotalArray,
) -> None:
    """Fill the bounds of some turns; `cells`, shape (turns, n, 2), is (column, row) of each point."""
    blocks, rows, cols = bounds.shape[1], coarse.shape[2], coarse.shape[3]
    for k in range(first, last):
        for i in range(cells.shape[1]):
            row, col = cells[k, i, 1] + BLOCK, cells[k, i, 0] + BLOCK
            top, left = row // BLOCK, col // BLOCK
            best = coarse[row % BLOCK, col % BLOCK]
            for by in range(max(0, -top), min(blocks, rows - top)):
                for bx in range(max(0, -left), min(blocks, cols - left)):
                    bounds[k, by, bx] += best[top + by, left + bx]


@kernel
def open_blocks(
    order: NDArray[np.int64],
    first: int,
    last: int,
    ratio: float,
    cells: CellIndices,
    corner: FloatArray,
    angles_rad: FloatArray,
    bounds: TotalArray,
    fine: ByteArray,
    apart: float,
    apart_rad: float,
    poses: FloatArray,
    totals: FloatArray,
) -> int:
    """Look at every pose of some blocks, in cells and radians; return how many are done, all if enough."""
    blocks, (rows, cols) = bounds.shape[1], fine.shape
    total = np.empty((BLOCK, BLOCK), dtype=np.int32)
    for at in range(first, last):
        index = order[at]
        k, by, bx = index // (blocks * blocks), (index // blocks) % blocks, index % blocks
        if bounds[k, by, bx] <= totals[-1] or bounds[k, by, bx] < ratio * totals[0]:
            return order.size
        total[:] = 0
        for i in range(cells.shape[1]):
            row, col = cells[k, i, 1] + by * BLOCK, cells[k, i, 0] + bx * BLOCK
            for dy in range(max(0, -row), min(BLOCK, rows - row)):
                for dx in range(max(0, -col), min(BLOCK, cols - col)):
                    total[dy, dx] += fine[row + dy, col + dx]
        best = int(np.argmax(total))
        dy, dx = best // BLOCK, best % BLOCK
        _enter(
            poses,
            totals,
            corner[0] + bx * BLOCK + dx,
            corner[1] + by * BLOCK + dy,
            angles_rad[k],
            float(total[dy, dx]),
            apart,
            apart_rad,
        )
    return last


@kernel
def _enter(
    poses: FloatArray,
    totals: FloatArray,
    x: float,
    y: float,
    theta: float,
    total: float,
    apart: float,
    apart_rad: float,
) -> None:
    """Put a pose into the ordered list; neighbours of a better one stay out, worse neighbours go."""
    most = totals.shape[0]
    kept, keep_poses, keep_totals = 0, poses.copy(), totals.copy()
    placed = False
    for j in range(most):
        if totals[j] < 0.0:
            break
        if not placed and total > totals[j]:
            if kept < most:
                keep_poses[kept, 0], keep_poses[kept, 1], keep_poses[kept, 2] = x, y, theta
                keep_totals[kept] = total
                kept += 1
            placed = True
        off = math.hypot(x - poses[j, 0], y - poses[j, 1])
        turn = abs((theta - poses[j, 2] + math.pi) % (2.0 * math.pi) - math.pi)
        if off <= apart and turn <= apart_rad:
            if not placed:
                return
            continue
        if kept < most:
            keep_poses[kept] = poses[j]
            keep_totals[kept] = totals[j]
            kept += 1
    if not placed and kept < most:
        keep_poses[kept, 0], keep_poses[kept, 1], keep_poses[kept, 2] = x, y, theta
        keep_totals[kept] = total
        kept += 1
    for j in range(kept, most):
        keep_totals[j] = -1.0
    poses[:], totals[:] = keep_poses, keep_totals
