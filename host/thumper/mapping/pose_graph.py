"""A pose graph: relative poses between places, made consistent by least squares."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.geometry import FloatArray, Pose2, wrap_angle

DENSE_NODES = 300  # up to here a dense solution takes less than 0.1 s and 7 MB
MOST_STEPS = 12
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
    """Bends poses until the edges agree, one step a call: a robot cannot wait for all of them.

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
        self._left = MOST_STEPS

    def step(self) -> bool:
        """Take one step; whether it was the last one."""
        first, second, information = self._first, self._second, self._information
        error, a, b = _linearised(self.poses[first], self.poses[second], self._measured)
        squared = np.sum(information * error * error, axis=1)
        weight = np.where(self._loop, 1.0 / (1.0 + squared / 9.0), 1.0)[:, np.newaxis] * information
        step = _solve(self.poses.shape[0], first, second, error, a, b, weight)
        self.poses += step
        self.poses[:, 2] = np.remainder(self.poses[:, 2] + math.pi, math.tau) - math.pi
        self._left -= 1
        return self._left == 0 or float(np.abs(step).max()) < 1e-5


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


def _solve(
    n: int,
    first: np.ndarray[tuple[int], np.dtype[np.int64]],
    second: np.ndarray[tuple[int], np.dtype[np.int64]],
    error: FloatArray,
    a: FloatArray,
    b: FloatArray,
    weight: FloatArray,
) -> FloatArray:
    rows, cols, values = [], [], []
    right = np.zeros((n, 3))
    for i, left in ((first, a), (second, b)):
        weighted = left * weight[:, :, np.newaxis]
        np.add.at(right, i, -np.einsum("mki,mk->mi", weighted, error))
        for j, other in ((first, a), (second, b)):
            block = np.einsum("mki,mkj->mij", weighted, other)
            rows.append(np.repeat(3 * i[:, np.newaxis] + np.arange(3), 3, axis=1).ravel())
            cols.append(np.tile(3 * j[:, np.newaxis] + np.arange(3), (1, 3)).ravel())
            values.append(block.ravel())
    rows.append(np.arange(3))
    cols.append(np.arange(3))
    values.append(np.full(3, FIXED))
    row, col, value = np.concatenate(rows), np.concatenate(cols), np.concatenate(values)
    if n <= DENSE_NODES:
        dense = np.bincount(row * 3 * n + col, weights=value, minlength=9 * n * n).reshape(3 * n, 3 * n)
        return np.asarray(np.linalg.solve(dense, right.ravel())).reshape(n, 3)
    from scipy.sparse import coo_matrix  # 25 MB that most drives never need
    from scipy.sparse.linalg import spsolve

    system = coo_matrix((value, (row, col)), shape=(3 * n, 3 * n))
    return np.asarray(spsolve(system.tocsc(), right.ravel())).reshape(n, 3)
