"""Linear algebra in three unknowns without LAPACK, whose import costs 20 MB and half a second."""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel


@kernel
def cholesky3(matrix: FloatArray) -> FloatArray:
    """Return the lower factor of a symmetric positive matrix, shape (3, 3); pivots are at least 1e-6."""
    lower = np.zeros((3, 3))
    for i in range(3):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = math.sqrt(max(total, 1e-12)) if i == j else total / lower[j, j]
    return lower


@kernel
def solve3(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve `matrix x = right` for a symmetric positive matrix, shapes (3, 3) and (3,)."""
    lower = cholesky3(matrix)
    x = np.empty(3)
    for i in range(3):
        total = right[i]
        for k in range(i):
            total -= lower[i, k] * x[k]
        x[i] = total / lower[i, i]
    for i in range(2, -1, -1):
        total = x[i]
        for k in range(i + 1, 3):
            total -= lower[k, i] * x[k]
        x[i] = total / lower[i, i]
    return x


@kernel
def inverse3(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a symmetric positive matrix, shape (3, 3)."""
    out, unit = np.empty((3, 3)), np.zeros(3)
    for k in range(3):
        unit[:] = 0.0
        unit[k] = 1.0
        out[:, k] = solve3(matrix, unit)
    return out


@kernel
def sample3(information: FloatArray, normal: FloatArray) -> FloatArray:
    """Turn standard normal numbers, shape (3,), into a draw from N(0, information^-1): L^T x = normal."""
    lower = cholesky3(information)
    x = normal.copy()
    for i in range(2, -1, -1):
        for k in range(i + 1, 3):
            x[i] -= lower[k, i] * x[k]
        x[i] /= lower[i, i]
    return x
