"""A pose graph: relative poses between places, made consistent by least squares, a part at a time."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2, wrap_angle
from thumper.common.numba_kernel import kernel

MOST_STEPS = 12
PRODUCTS_AT_ONCE = 2_000_000  # in one part of a factorisation: some ms
FIXED = 1e9  # information that nails the first node down: the map's origin must not float


@dataclass(frozen=True, slots=True, kw_only=True)
class Edge:
    """`second` seen from `first`, and how well that is known."""

    first: int
    second: int
    first_from_second: Pose2
    std_m: float
    std_rad: float
    loop: bool  # weighed down when it disagrees with the rest; the chain of the drive is not
    length_m: float  # way between the two, for distances within the graph


class Solver:
    """Bends poses until the edges agree, a part of a step a call: a robot cannot wait for all of them.

    Gauss-Newton with Cauchy weights on the loops (Grisetti, Kuemmerle, Stachniss, Burgard, "A tutorial on
    graph-based SLAM", IEEE ITS Magazine 2(4), 2010).
    """

    def __init__(self, poses: FloatArray, edges: list[Edge]) -> None:
        """Begin with poses, shape (n, 3); node 0 will stay. Edges beyond these nodes are left out."""
        edges = [edge for edge in edges if max(edge.first, edge.second) < len(poses)]
        self.poses = poses.copy()
        self._first = np.array([edge.first for edge in edges])
        self._second = np.array([edge.second for edge in edges])
        self._measured = np.array([[*_row(edge.first_from_second)] for edge in edges])
        self._information = np.array([[edge.std_m**-2, edge.std_m**-2, edge.std_rad**-2] for edge in edges])
        self._loop = np.array([edge.loop for edge in edges])
        self._rank = _ranks(len(poses), edges)
        self._width = 3 * int(np.abs(self._rank[self._first] - self._rank[self._second]).max(initial=0)) + 2
        self._band: FloatArray = np.zeros((0, 0))
        self._right: FloatArray = np.zeros(0)
        self._factored = 0  # rows
        self._left = MOST_STEPS

    def step(self) -> bool:
        """Do a part of a step; whether it ended the last one."""
        if not self._band.size:
            self._linearise()
        last = min(len(self._band), self._factored + max(1, PRODUCTS_AT_ONCE // self._width**2))
        factor(self._band, self._factored, last)
        self._factored = last
        if last < len(self._band):
            return False
        substitute(self._band, self._right)
        step = self._right.reshape(-1, 3)[self._rank]
        self._band, self._factored = np.zeros((0, 0)), 0
        self.poses += step
        self.poses[:, 2] = np.remainder(self.poses[:, 2] + math.pi, math.tau) - math.pi
        self._left -= 1
        return self._left == 0 or float(np.abs(step).max()) < 1e-5

    def _linearise(self) -> None:
        """Fill the lower band of the normal equations, their rows in the order of the ranks."""
        n, width, information = self.poses.shape[0], self._width, self._information
        first, second = self._rank[self._first], self._rank[self._second]
        error, a, b = _linearised(self.poses[self._first], self.poses[self._second], self._measured)
        squared = np.sum(information * error * error, axis=1)
        weight = np.where(self._loop, 1.0 / (1.0 + squared / 9.0), 1.0)[:, np.newaxis] * information
        fixed = 3 * self._rank[0] + np.arange(3)
        rows, cols, values, right = [fixed], [fixed], [np.full(3, FIXED)], np.zeros((n, 3))
        for i, left in ((first, a), (second, b)):
            weighted = left * weight[:, :, np.newaxis]
            np.add.at(right, i, -np.einsum("mki,mk->mi", weighted, error))
            for j, other in ((first, a), (second, b)):
                block = np.einsum("mki,mkj->mij", weighted, other)
                rows.append(np.repeat(3 * i[:, np.newaxis] + np.arange(3), 3, axis=1).ravel())
                cols.append(np.tile(3 * j[:, np.newaxis] + np.arange(3), (1, 3)).ravel())
                values.append(block.ravel())
        row, col, value = np.concatenate(rows), np.concatenate(cols), np.concatenate(values)
        low = row >= col
        cell = row[low] * (width + 1) + col[low] - row[low] + width
        size = 3 * n * (width + 1)
        band = np.bincount(cell, weights=value[low], minlength=size)
        self._band = band.astype(np.float64).reshape(3 * n, width + 1)
        self._right = right.ravel()


def residual(poses: FloatArray, edge: Edge) -> tuple[float, float]:
    """How far [m, rad] the poses are from what the edge says."""
    one, two = (Pose2(x_m=p[0], y_m=p[1], theta_rad=p[2]) for p in poses[[edge.first, edge.second]])
    error = edge.first_from_second.inverse() @ (one.inverse() @ two)
    return math.hypot(error.x_m, error.y_m), abs(wrap_angle(error.theta_rad))


def _row(pose: Pose2) -> tuple[float, float, float]:
    return pose.x_m, pose.y_m, pose.theta_rad


def _linearised(
    one: FloatArray, two: FloatArray, measured: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Errors, shape (m, 3), in the first node's frame, and their Jacobians by either node, (m, 3, 3)."""
    cos, sin = np.cos(one[:, 2]), np.sin(one[:, 2])
    dx, dy = two[:, 0] - one[:, 0], two[:, 1] - one[:, 1]
    along, across = cos * dx + sin * dy, -sin * dx + cos * dy
    turn = two[:, 2] - one[:, 2] - measured[:, 2]
    error = np.column_stack(
        (along - measured[:, 0], across - measured[:, 1], np.remainder(turn + np.pi, math.tau) - np.pi)
    )
    a, b = np.zeros((len(one), 3, 3)), np.zeros((len(one), 3, 3))
    a[:, 0, 0], a[:, 0, 1], a[:, 0, 2] = -cos, -sin, across
    a[:, 1, 0], a[:, 1, 1], a[:, 1, 2] = sin, -cos, -along
    b[:, 0, 0], b[:, 0, 1], b[:, 1, 0], b[:, 1, 1] = cos, sin, -sin, cos
    a[:, 2, 2], b[:, 2, 2] = -1.0, 1.0
    return error, a, b


def _ranks(n: int, edges: list[Edge]) -> NDArray[np.int64]:
    """Number of each node in an order in which neighbours are near one another, shape (n,).

    Breadth first from one end, nodes of few neighbours first (Cuthill and McKee, "Reducing the bandwidth of
    sparse symmetric matrices", ACM 1969).
    """
    neighbours: list[set[int]] = [set() for _ in range(n)]
    for edge in edges:
        neighbours[edge.first].add(edge.second)
        neighbours[edge.second].add(edge.first)

    def order(start: int) -> list[int]:
        found, queue, seen = [], deque([start]), {start}
        while queue:
            node = queue.popleft()
            found.append(node)
            for other in sorted(neighbours[node] - seen, key=lambda k: (len(neighbours[k]), k)):
                seen.add(other)
                queue.append(other)
        return found

    rank = np.zeros(n, dtype=np.int64)
    rank[order(order(0)[-1])] = np.arange(n)  # all are tied to the chain of the drive
    return rank


@kernel
def factor(band: FloatArray, first: int, last: int) -> None:
    """Cholesky's factor of some rows of a symmetric matrix, in place; those before them have been done.

    `band`, shape (n, width + 1), holds element (i, j) of the lower triangle at [i, j - i + width].
    """
    width = band.shape[1] - 1
    for i in range(first, last):
        for j in range(max(0, i - width), i + 1):
            value = band[i, j - i + width]
            for k in range(max(0, i - width), j):
                value -= band[i, k - i + width] * band[j, k - j + width]
            band[i, j - i + width] = math.sqrt(value) if i == j else value / band[j, width]


@kernel
def substitute(band: FloatArray, right: FloatArray) -> None:
    """Solve with the factor, in place; `right` has shape (n,)."""
    n, width = band.shape[0], band.shape[1] - 1
    for i in range(n):
        for k in range(max(0, i - width), i):
            right[i] -= band[i, k - i + width] * right[k]
        right[i] /= band[i, width]
    for i in range(n - 1, -1, -1):
        right[i] /= band[i, width]
        for k in range(max(0, i - width), i):
            right[k] -= band[i, k - i + width] * right[i]
