"""Polylines on a priced grid: how long, how dear, how straight. Kernels in cells, wrappers in metres."""

import math

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel
from thumper.navigation.planners.astar_search import CostArray

SAMPLES_PER_CELL = 4


@kernel
def line_cost(prices: CostArray, x0: float, y0: float, x1: float, y1: float) -> float:
    """Integral of the price along a line given in cells; inf when it meets an obstacle or leaves the grid."""
    rows, cols = prices.shape
    length = math.hypot(x1 - x0, y1 - y0)
    count = max(1, math.ceil(SAMPLES_PER_CELL * length))
    total = 0.0
    for i in range(count + 1):
        t = i / count
        col, row = math.floor(x0 + t * (x1 - x0)), math.floor(y0 + t * (y1 - y0))
        if row < 0 or col < 0 or row >= rows or col >= cols:
            return np.inf
        weight = 0.5 if i in (0, count) else 1.0
        total += weight * prices[row, col]
    return total * length / count


@kernel
def shortcut(prices: CostArray, points: FloatArray, reach: int) -> FloatArray:
    """Replace stretches of up to `reach` points, shape (n, 2) [cells], by a line where that is no dearer."""
    count = points.shape[0]
    prefix = np.zeros(count)
    for i in range(1, count):
        x0, y0 = points[i - 1]
        x1, y1 = points[i]
        prefix[i] = prefix[i - 1] + line_cost(prices, x0, y0, x1, y1)
    kept = np.empty((count, 2))
    kept[0] = points[0]
    size = 1
    anchor = 0
    while anchor < count - 1:
        best = anchor + 1
        misses = 0
        for j in range(anchor + 2, min(count, anchor + reach + 1)):
            direct = line_cost(prices, points[anchor, 0], points[anchor, 1], points[j, 0], points[j, 1])
            if direct <= prefix[j] - prefix[anchor] + 1e-6:
                best = j
                misses = 0
            else:
                misses += 1
                if misses > 5:
                    break
        anchor = best
        kept[size] = points[anchor]
        size += 1
    return kept[:size].copy()


@kernel
def smooth(prices: CostArray, points: FloatArray, rounds: int) -> None:
    """Round the corners of a polyline, shape (n, 2) [cells], in place; no point moves somewhere dear."""
    for _ in range(rounds):
        for i in range(1, points.shape[0] - 1):
            x = points[i, 0] + 0.25 * (points[i - 1, 0] + points[i + 1, 0] - 2.0 * points[i, 0])
            y = points[i, 1] + 0.25 * (points[i - 1, 1] + points[i + 1, 1] - 2.0 * points[i, 1])
            old = prices[math.floor(points[i, 1]), math.floor(points[i, 0])]
            new = prices[math.floor(y), math.floor(x)]
            if new <= old + 0.5:
                points[i, 0], points[i, 1] = x, y


@kernel
def polyline_cost(prices: CostArray, points: FloatArray) -> float:
    """Cost of a polyline, shape (n, 2) [cells]; inf when it touches an obstacle."""
    total = 0.0
    for i in range(1, points.shape[0]):
        total += line_cost(prices, points[i - 1, 0], points[i - 1, 1], points[i, 0], points[i, 1])
    return total


def resample(points: FloatArray, spacing: float) -> FloatArray:
    """Points along the polyline, shape (n, 2), about `spacing` apart (same unit), both ends kept."""
    along = arc_lengths(points)
    count = max(2, math.ceil(along[-1] / spacing) + 1)
    stations = np.linspace(0.0, along[-1], count)
    return np.column_stack(
        (np.interp(stations, along, points[:, 0]), np.interp(stations, along, points[:, 1]))
    )


def arc_lengths(points: FloatArray) -> FloatArray:
    """Way along the polyline up to each of its points, shape (n,), same unit."""
    steps = np.hypot(np.diff(points[:, 0]), np.diff(points[:, 1]))
    return np.concatenate((np.zeros(1), np.cumsum(steps)))


def nearest_place(points: FloatArray, x: float, y: float) -> tuple[int, float]:
    """Where a polyline, shape (n, 2), is nearest to (x, y): the index of a segment, and the way along it."""
    steps, away = np.diff(points, axis=0), np.array((x, y)) - points[:-1]
    squared = np.maximum((steps**2).sum(axis=1), np.finfo(np.float64).tiny)
    part = np.clip((away * steps).sum(axis=1) / squared, 0.0, 1.0)
    segment = int(np.argmin(((away - part[:, None] * steps) ** 2).sum(axis=1)))
    return segment, float(part[segment] * math.sqrt(squared[segment]))


def nearest_index(points: FloatArray, x: float, y: float) -> int:
    """Index of the vertex nearest to (x, y)."""
    return int(np.argmin((points[:, 0] - x) ** 2 + (points[:, 1] - y) ** 2))
