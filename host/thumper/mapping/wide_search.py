"""Correlative search of a large window by branch and bound, for loops, relocalisation and kidnapped robots.

Two levels of Hess, Kohler, Rapp, Andor, "Real-time loop closure in 2D LIDAR SLAM", ICRA 2016: a map whose
cells hold the best of a block bounds every pose of that block from above; blocks are opened best first until
no bound beats what was found.
"""

import math
from dataclasses import dataclass

import numpy as np

from thumper.geometry import FloatArray, Pose2, wrap_angle
from thumper.kernel import kernel
from thumper.mapping.cells import Cells
from thumper.mapping.distance_field import FieldArray
from thumper.mapping.patches import ByteArray

BLOCK = 8  # cells along a block of poses
STEP_RAD = math.radians(1.5)  # 0.13 m at 5 m: well inside the matcher's basin
APART_M, APART_RAD = 1.0, 0.35  # a rival this far away is another place, not a neighbour of the best


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """The best pose of a window and how far it stands out."""

    pose: Pose2
    score: float  # mean likelihood of the beams there, 0...1
    rival: float  # the best score of any place clearly apart, or its upper bound


class SearchField:
    """A map made ready for many wide searches."""

    def __init__(
        self, distance_m: FieldArray, resolution_m: float, corner_m: tuple[float, float], std_m: float
    ) -> None:
        """`distance_m` as in `Cells`; `std_m` is the width of a beam's likelihood."""
        self.resolution_m, self.corner_m = resolution_m, corner_m
        far = distance_m >= distance_m.max(initial=np.float32(resolution_m))
        likelihood = 255.0 * np.exp(-0.5 * (distance_m / np.float32(std_m)) ** 2)
        self._fine = np.where(far, 0, likelihood).astype(np.uint8)
        self._coarse = block_maximum(self._fine)

    @classmethod
    def of(cls, cells: Cells, std_m: float) -> "SearchField":
        """The field of a map in the making."""
        return cls(cells.distance_m, cells.resolution_m, cells.corner_m, std_m)

    def search(self, points_m: FloatArray, centre: Pose2, window_m: float, window_rad: float) -> Found:
        """Return the best pose within +- window of `centre` for points in the base frame, shape (n, 2)."""
        poses, scores = self._best(points_m, centre, window_m, window_rad, 2, 0.7)
        x_m, y_m, theta_rad = (float(value) for value in poses[0])
        return Found(
            pose=Pose2(x_m=x_m, y_m=y_m, theta_rad=wrap_angle(theta_rad)),
            score=float(scores[0]),
            rival=float(scores[1]),
        )

    def search_all(
        self, points_m: FloatArray, centre: Pose2, window_m: float, window_rad: float, most: int, ratio: float
    ) -> FloatArray:
        """The best pose and those clearly apart that explain `ratio` as much, shape (1...most, 3)."""
        poses, scores = self._best(points_m, centre, window_m, window_rad, most, ratio)
        return np.asarray(poses[: max(1, int(np.count_nonzero(scores >= ratio * scores[0])))])

    def _best(
        self, points_m: FloatArray, centre: Pose2, window_m: float, window_rad: float, most: int, ratio: float
    ) -> tuple[FloatArray, FloatArray]:
        """Poses in the map, shape (most, 3), and their scores, the best first."""
        n_theta = math.ceil(window_rad / STEP_RAD)
        if 2 * n_theta * STEP_RAD >= math.tau:
            n_theta = math.floor(math.pi / STEP_RAD)
        poses, scores = _search(
            np.ascontiguousarray(points_m) / self.resolution_m,
            (centre.x_m - self.corner_m[0]) / self.resolution_m,
            (centre.y_m - self.corner_m[1]) / self.resolution_m,
            centre.theta_rad,
            math.ceil(window_m / self.resolution_m),
            n_theta,
            STEP_RAD,
            APART_M / self.resolution_m,
            APART_RAD,
            most,
            ratio,
            self._fine,
            self._coarse,
        )
        poses[:, :2] = poses[:, :2] * self.resolution_m + np.array(self.corner_m)
        return poses, scores


@kernel
def block_maximum(fine: ByteArray) -> ByteArray:
    """Best of the BLOCK x BLOCK cells that begin at each cell, itself the lowest corner."""
    rows, cols = fine.shape
    out = np.zeros((rows + BLOCK, cols + BLOCK), dtype=np.uint8)  # blocks may begin below and left of the map
    wide = np.zeros((rows, cols + BLOCK), dtype=np.uint8)
    for r in range(rows):
        for c in range(cols + BLOCK):
            best = 0
            for k in range(max(0, c - BLOCK), min(cols, c)):
                best = max(best, fine[r, k])
            wide[r, c] = best
    for r in range(rows + BLOCK):
        for c in range(cols + BLOCK):
            best = 0
            for k in range(max(0, r - BLOCK), min(rows, r)):
                best = max(best, wide[k, c])
            out[r, c] = best
    return out


@kernel
def _search(
    points: FloatArray,
    x: float,
    y: float,
    theta: float,
    window: int,
    n_theta: int,
    step_rad: float,
    apart: float,
    apart_rad: float,
    most: int,
    ratio: float,
    fine: ByteArray,
    coarse: ByteArray,
) -> tuple[FloatArray, FloatArray]:
    """All lengths in cells. Returns up to `most` poses clearly apart, and their scores, the best first.

    Scores below `ratio` of the best are not looked for; poses that were not found are the centre's.
    """
    n, blocks = points.shape[0], (2 * window) // BLOCK + 1
    turns = 2 * n_theta + 1
    bounds = np.empty(turns * blocks * blocks, dtype=np.float32)
    rows, cols = coarse.shape
    turned = np.empty((turns, n, 2), dtype=np.int32)
    for k in range(turns):
        angle = theta + (k - n_theta) * step_rad
        cos, sin = math.cos(angle), math.sin(angle)
        for i in range(n):
            turned[k, i, 0] = math.floor(x + cos * points[i, 0] - sin * points[i, 1]) - window
            turned[k, i, 1] = math.floor(y + sin * points[i, 0] + cos * points[i, 1]) - window
        for by in range(blocks):
            for bx in range(blocks):
                total = 0
                for i in range(n):
                    # A block's cells are [c, c + BLOCK); `coarse` is shifted by BLOCK.
                    col, row = turned[k, i, 0] + bx * BLOCK + BLOCK, turned[k, i, 1] + by * BLOCK + BLOCK
                    if 0 <= col < cols and 0 <= row < rows:
                        total += coarse[row, col]
                bounds[(k * blocks + by) * blocks + bx] = total
    order = np.argsort(-bounds)
    poses, totals = np.empty((most, 3)), np.full(most, -1.0)
    for j in range(most):
        poses[j, 0], poses[j, 1], poses[j, 2] = x, y, theta
    for index in order:
        bound = bounds[index]
        if bound <= totals[most - 1] or bound < ratio * totals[0]:
            break
        k, by, bx = index // (blocks * blocks), (index // blocks) % blocks, index % blocks
        local, at_x, at_y = -1, 0, 0
        for dy in range(BLOCK):
            for dx in range(BLOCK):
                total = 0
                for i in range(n):
                    col, row = turned[k, i, 0] + bx * BLOCK + dx, turned[k, i, 1] + by * BLOCK + dy
                    if 0 <= col < fine.shape[1] and 0 <= row < fine.shape[0]:
                        total += fine[row, col]
                if total > local:
                    local, at_x, at_y = total, bx * BLOCK + dx - window, by * BLOCK + dy - window
        _enter(poses, totals, x + at_x, y + at_y, theta + (k - n_theta) * step_rad, local, apart, apart_rad)
    return poses, np.maximum(totals, 0.0) / (255.0 * n)


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
