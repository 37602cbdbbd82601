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
        n_theta = math.ceil(window_rad / STEP_RAD)
        if 2 * n_theta * STEP_RAD >= math.tau:
            n_theta = math.floor(math.pi / STEP_RAD)
        pose, score, rival = _search(
            np.ascontiguousarray(points_m) / self.resolution_m,
            (centre.x_m - self.corner_m[0]) / self.resolution_m,
            (centre.y_m - self.corner_m[1]) / self.resolution_m,
            centre.theta_rad,
            math.ceil(window_m / self.resolution_m),
            n_theta,
            STEP_RAD,
            APART_M / self.resolution_m,
            APART_RAD,
            self._fine,
            self._coarse,
        )
        x_m = pose[0] * self.resolution_m + self.corner_m[0]
        y_m = pose[1] * self.resolution_m + self.corner_m[1]
        found = Pose2(x_m=x_m, y_m=y_m, theta_rad=wrap_angle(pose[2]))
        return Found(pose=found, score=score, rival=rival)


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
    fine: ByteArray,
    coarse: ByteArray,
) -> tuple[FloatArray, float, float]:
    """All lengths in cells. Returns pose, score, rival's score."""
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
    best, rival = -1, 0
    pose = np.array([x, y, theta])
    for index in order:
        bound = bounds[index]
        if bound <= rival or (best >= 0 and bound < 0.7 * best):
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
        if local < 0:
            continue
        angle = theta + (k - n_theta) * step_rad
        off = math.hypot(x + at_x - pose[0], y + at_y - pose[1])
        turn = abs((angle - pose[2] + math.pi) % (2.0 * math.pi) - math.pi)
        elsewhere = off > apart or turn > apart_rad
        if local > best:
            if elsewhere and best > rival:
                rival = best
            best = local
            pose[0], pose[1], pose[2] = x + at_x, y + at_y, angle
        elif elsewhere and local > rival:
            rival = local
    return pose, best / (255.0 * n), rival / (255.0 * n)
