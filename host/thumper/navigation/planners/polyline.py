"""Polylines: length, cost on a grid, shortcutting, smoothing. Kernels in cells, the rest in any unit."""

import math

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.numba_kernel import kernel
from thumper.navigation.planners.cell_costs import CellCosts, cost_at

SAMPLES_PER_CELL = 4


@kernel
def line_cost(cells: CellCosts, x0: float, y0: float, x1: float, y1: float) -> float:
    """Integrate the cost along a line given in cells; inf if it meets an obstacle or leaves the grid."""
    rows, cols = cells.costs.shape
    length = math.hypot(x1 - x0, y1 - y0)
    count = max(1, math.ceil(SAMPLES_PER_CELL * length))
    total = 0.0
    for i in range(count + 1):
        t = i / count
        col, row = math.floor(x0 + t * (x1 - x0)), math.floor(y0 + t * (y1 - y0))
        if row < 0 or col < 0 or row >= rows or col >= cols:
            return np.inf
        weight = 0.5 if i in (0, count) else 1.0
        total += weight * float(cost_at(cells, row, col))
    return total * length / count


@kernel
def shortcut(cells: CellCosts, points: FloatArray, max_points: int) -> FloatArray:
    """Replace runs of up to `max_points` points, shape (n, 2) [cells], by a line that costs no more."""
    count = points.shape[0]
    prefix = np.zeros(count)
    for i in range(1, count):
        x0, y0 = points[i - 1]
        x1, y1 = points[i]
        prefix[i] = prefix[i - 1] + line_cost(cells, x0, y0, x1, y1)
    kept = np.empty((count, 2))
    kept[0] = points[0]
    size = 1
    anchor = 0
    while anchor < count - 1:
        best = anchor + 1
        misses = 0
        for j in range(anchor + 2, min(count, anchor + max_points + 1)):
            direct = line_cost(cells, points[anchor, 0], points[anchor, 1], points[j, 0], points[j, 1])
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
def smooth(cells: CellCosts, points: FloatArray, rounds: int) -> None:
    """Round the corners of a polyline, shape (n, 2) [cells], in place; no point moves to a costly cell."""
    for _ in range(rounds):
        for i in range(1, points.shape[0] - 1):
            x = points[i, 0] + 0.25 * (points[i - 1, 0] + points[i + 1, 0] - 2.0 * points[i, 0])
            y = points[i, 1] + 0.25 * (points[i - 1, 1] + points[i + 1, 1] - 2.0 * points[i, 1])
            old = cost_at(cells, math.floor(points[i, 1]), math.floor(points[i, 0]))
            new = cost_at(cells, math.floor(y), math.floor(x))
            if new <= old + 0.5:
                points[i, 0], points[i, 1] = x, y


@kernel
def polyline_cost(cells: CellCosts, points: FloatArray) -> float:
    """Return the cost of a polyline, shape (n, 2) [cells]; inf if it touches an obstacle."""
    total = 0.0
    for i in range(1, points.shape[0]):
        total += line_cost(cells, points[i - 1, 0], points[i - 1, 1], points[i, 0], points[i, 1])
    return total


def resample(points: FloatArray, spacing: float) -> FloatArray:
    """Return points along the polyline, shape (n, 2), about `spacing` apart, with both ends kept."""
    along = arc_lengths(points)
    count = max(2, math.ceil(along[-1] / spacing) + 1)
    stations = np.linspace(0.0, along[-1], count)
    return np.column_stack(
        (np.interp(stations, along, points[:, 0]), np.interp(stations, along, points[:, 1]))
    )


def arc_lengths(points: FloatArray) -> FloatArray:
    """Return the distance along the polyline to each of its points, shape (n,), in the same unit."""
    steps = np.hypot(np.diff(points[:, 0]), np.diff(points[:, 1]))
    return np.concatenate((np.zeros(1), np.cumsum(steps)))


def project_onto(points: FloatArray, x: float, y: float) -> tuple[int, float]:
    """Project (x, y) onto a polyline, shape (n, 2): index of the segment, and the distance along it."""
    steps, offsets = np.diff(points, axis=0), np.array((x, y)) - points[:-1]
    squared = np.maximum((steps**2).sum(axis=1), np.finfo(np.float64).tiny)
    fraction = np.clip((offsets * steps).sum(axis=1) / squared, 0.0, 1.0)
    segment = int(np.argmin(((offsets - fraction[:, None] * steps) ** 2).sum(axis=1)))
    return segment, float(fraction[segment] * math.sqrt(squared[segment]))


def nearest_vertex(points: FloatArray, x: float, y: float) -> int:
    """Return the index of the vertex nearest to (x, y)."""
    return int(np.argmin((points[:, 0] - x) ** 2 + (points[:, 1] - y) ** 2))


def index_at(points: FloatArray, distance: float) -> int:
    """Return the index of the first vertex at least `distance` along the polyline, else of the last one."""
    return min(int(np.searchsorted(arc_lengths(points), distance)), len(points) - 1)


def ahead(path_m: FloatArray, map_from_base: Pose2, distance_m: float) -> FloatArray:
    """Return the path's vertices, shape (n, 2), from beside the robot to `distance_m` further on.

    The last vertex is the first one at least `distance_m` along the path, or the path's end.
    """
    rest_m = path_m[nearest_vertex(path_m, map_from_base.x_m, map_from_base.y_m) :]
    return np.ascontiguousarray(rest_m[: index_at(rest_m, distance_m) + 1])
