"""Pose-graph optimization: relative poses between submaps, made consistent by least squares, in parts.

Follows Grisetti, Kuemmerle, Stachniss, Burgard, "A tutorial on graph-based SLAM", IEEE ITS
Magazine 2(4), 2010.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2, wrap_angle
from thumper.common.numba_kernel import kernel

MAX_ITERATIONS = 12
PRODUCTS_PER_PART = 2_000_000  # of the factorization: a few ms
FIXED_INFORMATION = 1e9  # of the first node: the map's origin must not move
PLAIN_ITERATIONS = 4  # without the robust kernel, which holds right edges back far from the solution
LOOP_KERNEL_STD = 3.0  # Cauchy kernel: a loop edge this far off has half its weight


@dataclass(frozen=True, slots=True, kw_only=True)
class Edge:
    """The pose of node `second` in the frame of node `first`, and how well it is known."""

    first: int
    second: int
    first_from_second: Pose2
    information: FloatArray  # inverse covariance of x, y, theta in the frame of `first`, shape (3, 3)
    loop: bool  # loop edges have a robust kernel, odometry edges do not
    length_m: float  # distance between the two, for path lengths in the graph


class Solver:
    """Gauss-Newton with Cauchy weights on the loop edges.

    Each call runs a part of an iteration: a robot cannot wait for the whole solution.
    """

    def __init__(self, poses: FloatArray, edges: list[Edge]) -> None:
        """Start from poses, shape (n, 3). Node 0 stays fixed; edges beyond these nodes are ignored."""
        edges = [edge for edge in edges if max(edge.first, edge.second) < len(poses)]
        self.poses = poses.copy()
        self._first = np.array([edge.first for edge in edges])
        self._second = np.array([edge.second for edge in edges])
        self._measured = np.array([[*_row(edge.first_from_second)] for edge in edges])
        self._information = np.array([edge.information for edge in edges])
        self._loop = np.array([edge.loop for edge in edges])
        self._rank = _ranks(len(poses), edges)
        self._width = 3 * int(np.abs(self._rank[self._first] - self._rank[self._second]).max(initial=0)) + 2
        self._band: FloatArray = np.zeros((0, 0))
        self._right: FloatArray = np.zeros(0)
        self._rows_factored = 0
        self._iterations_left = MAX_ITERATIONS
        self._robust = False

    def run_part(self) -> bool:
        """Run a part of an iteration and return whether the solution is final."""
        if not self._band.size:
            self._linearize()
        count = max(1, PRODUCTS_PER_PART // self._width**2)
        last = min(len(self._band), self._rows_factored + count)
        factor(self._band, self._rows_factored, last)
        self._rows_factored = last
        if last < len(self._band):
            return False
        substitute(self._band, self._right)
        step = self._right.reshape(-1, 3)[self._rank]
        self._band, self._rows_factored = np.zeros((0, 0)), 0
        self.poses += step
        self.poses[:, 2] = np.remainder(self.poses[:, 2] + math.pi, math.tau) - math.pi
        self._iterations_left -= 1
        converged = float(np.abs(step).max()) < 1e-5
        finished = self._iterations_left == 0 or (converged and self._robust)
        self._robust |= converged or self._iterations_left <= MAX_ITERATIONS - PLAIN_ITERATIONS
        return finished

    def _linearize(self) -> None:
        """Fill the lower band of H and the vector b, rows in the order of the ranks."""
        n, width, information = self.poses.shape[0], self._width, self._information
        first, second = self._rank[self._first], self._rank[self._second]
        error, a, b = _error_and_jacobians(self.poses[self._first], self.poses[self._second], self._measured)
        squared = np.einsum("mi,mij,mj->m", error, information, error)
        robust = np.where(self._robust & self._loop, 1.0 / (1.0 + squared / LOOP_KERNEL_STD**2), 1.0)
        weight = robust[:, np.newaxis, np.newaxis] * information
        fixed = 3 * self._rank[0] + np.arange(3)
        rows, cols, values, right = [fixed], [fixed], [np.full(3, FIXED_INFORMATION)], np.zeros((n, 3))
        for i, left in ((first, a), (second, b)):
            weighted = np.einsum("mkj,mji->mki", weight, left)
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
    """Return by how much [m, rad] the relative pose differs from the edge."""
    first, second = (Pose2(x_m=p[0], y_m=p[1], theta_rad=p[2]) for p in poses[[edge.first, edge.second]])
    error = edge.first_from_second.inverse() @ (first.inverse() @ second)
    return math.hypot(error.x_m, error.y_m), abs(wrap_angle(error.theta_rad))


def _row(pose: Pose2) -> tuple[float, float, float]:
    return pose.x_m, pose.y_m, pose.theta_rad


def _error_and_jacobians(
    first: FloatArray, second: FloatArray, measured: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return errors in the first node's frame, shape (m, 3), and their Jacobians A and B, (m, 3, 3).

    The tutorial's error function of 2D poses, and its derivatives by the first and the second pose.
    """
    cos, sin = np.cos(first[:, 2]), np.sin(first[:, 2])
    dx, dy = second[:, 0] - first[:, 0], second[:, 1] - first[:, 1]
    along, across = cos * dx + sin * dy, -sin * dx + cos * dy
    turn = second[:, 2] - first[:, 2] - measured[:, 2]
    error = np.column_stack(
        (along - measured[:, 0], across - measured[:, 1], np.remainder(turn + np.pi, math.tau) - np.pi)
    )
    a, b = np.zeros((len(first), 3, 3)), np.zeros((len(first), 3, 3))
    a[:, 0, 0], a[:, 0, 1], a[:, 0, 2] = -cos, -sin, across
    a[:, 1, 0], a[:, 1, 1], a[:, 1, 2] = sin, -cos, -along
    b[:, 0, 0], b[:, 0, 1], b[:, 1, 0], b[:, 1, 1] = cos, sin, -sin, cos
    a[:, 2, 2], b[:, 2, 2] = -1.0, 1.0
    return error, a, b


def _ranks(n: int, edges: list[Edge]) -> NDArray[np.int64]:
    """Return a numbering of the nodes that keeps neighbours close together, shape (n,).

    Breadth first from one end, nodes with few neighbours first (Cuthill and McKee, "Reducing the bandwidth of
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
    rank[order(order(0)[-1])] = np.arange(n)  # odometry edges connect all nodes
    return rank


@kernel
def factor(band: FloatArray, first: int, last: int) -> None:
    """Compute rows `first` to `last` of a symmetric matrix's Cholesky factor, in place and in order.

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
    """Solve the system with the Cholesky factor, in place; `right` has shape (n,)."""
    n, width = band.shape[0], band.shape[1] - 1
    for i in range(n):
        for k in range(max(0, i - width), i):
            right[i] -= band[i, k - i + width] * right[k]
        right[i] /= band[i, width]
    for i in range(n - 1, -1, -1):
        right[i] /= band[i, width]
        for k in range(max(0, i - width), i):
            right[k] -= band[i, k - i + width] * right[i]
