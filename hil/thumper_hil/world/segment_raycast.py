"""Geometry kernels of the simulated world: rays, points and polygons against segments and circles.

All lengths in metres. Segments are rows (x0, y0, x1, y1); circles are rows (x, y, radius).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.common.numba_kernel import kernel

BoolArray = NDArray[np.bool_]
HitArray = NDArray[np.int32]


class WallSegment(NamedTuple):
    """A segment from a to b."""

    ax: float
    ay: float
    bx: float
    by: float


class GridGeometry(NamedTuple):
    """Cell size and lower corner of a grid."""

    resolution_m: float
    x_lo_m: float
    y_lo_m: float


@kernel
def cast_rays(
    origins_m: FloatArray,
    angles_rad: FloatArray,
    segments_m: FloatArray,
    circles_m: FloatArray,
    out: FloatArray,
    hit: HitArray,
) -> None:
    """Write the distance along each ray to its first hit, +inf for none, to `out`, shape (n,).

    `hit`, shape (n,), gets the index of the shape: segments first, then circles; -1 for none.

    `origins_m` has shape (n, 2), `angles_rad` (n,). A ray along a wall hits the wall's nearer end. A ray that
    starts inside a circle hits the far side of the circle.
    """
    for i in range(angles_rad.size):
        x, y = origins_m[i, 0], origins_m[i, 1]
        dx, dy = math.cos(angles_rad[i]), math.sin(angles_rad[i])
        nearest, hit[i] = math.inf, -1
        for k in range(segments_m.shape[0]):
            ax, ay = segments_m[k, 0] - x, segments_m[k, 1] - y
            bx, by = segments_m[k, 2] - x, segments_m[k, 3] - y
            # Signed distances of the ends from the ray's line: no crossing if both are on one side. Two walls
            # that share a corner get the same value for it, so that no ray slips between them.
            side_a, side_b = dx * ay - dy * ax, dx * by - dy * bx
            if (side_a > 0.0 and side_b > 0.0) or (side_a < 0.0 and side_b < 0.0):
                continue
            along_a, along_b = dx * ax + dy * ay, dx * bx + dy * by
            if abs(side_a - side_b) > 1e-12:
                share = min(max(side_a / (side_a - side_b), 0.0), 1.0)
                t = along_a + share * (along_b - along_a)
            elif along_a * along_b <= 0.0:
                t = 0.0  # parallel to the wall, and the origin is on it
            else:
                t = min(along_a, along_b)
            if 0.0 <= t < nearest:
                nearest, hit[i] = t, k
        for k in range(circles_m.shape[0]):
            cx, cy, radius = circles_m[k, 0] - x, circles_m[k, 1] - y, circles_m[k, 2]
            along = dx * cx + dy * cy
            side = dx * cy - dy * cx
            if abs(side) > radius:
                continue
            half_chord = math.sqrt(radius * radius - side * side)
            t = along - half_chord
            if t < 0.0:
                t = along + half_chord
            if 0.0 <= t < nearest:
                nearest, hit[i] = t, segments_m.shape[0] + k
        out[i] = nearest


@kernel
def point_segment_m(px: float, py: float, segment: WallSegment) -> float:
    """Return the distance from a point to a segment; a segment of length 0 is a point."""
    ax, ay, bx, by = segment
    ux, uy = bx - ax, by - ay
    length2 = ux * ux + uy * uy
    share = 0.0
    if length2 > 0.0:
        share = min(max(((px - ax) * ux + (py - ay) * uy) / length2, 0.0), 1.0)
    return math.hypot(px - ax - share * ux, py - ay - share * uy)


@kernel
def segments_cross(ab: WallSegment, cd: WallSegment) -> bool:
    """Return True if ab and cd cross inside both; `point_segment_m` covers touching ends."""
    ax, ay, bx, by = ab
    cx, cy, dx, dy = cd
    abx, aby, cdx, cdy = bx - ax, by - ay, dx - cx, dy - cy
    c_side, d_side = abx * (cy - ay) - aby * (cx - ax), abx * (dy - ay) - aby * (dx - ax)
    a_side, b_side = cdx * (ay - cy) - cdy * (ax - cx), cdx * (by - cy) - cdy * (bx - cx)
    return c_side * d_side < 0.0 and a_side * b_side < 0.0


@kernel
def inside_polygon(px: float, py: float, polygon_m: FloatArray) -> bool:
    """Return True if the point is inside (even-odd rule); `polygon_m` is open, shape (k, 2), k >= 3."""
    inside = False
    j = polygon_m.shape[0] - 1
    for i in range(polygon_m.shape[0]):
        yi, yj = polygon_m[i, 1], polygon_m[j, 1]
        if (yi > py) != (yj > py):
            x_cross = polygon_m[i, 0] + (py - yi) / (yj - yi) * (polygon_m[j, 0] - polygon_m[i, 0])
            if px < x_cross:
                inside = not inside
        j = i
    return inside


@kernel
def polygon_clearance_m(polygon_m: FloatArray, segments_m: FloatArray, circles_m: FloatArray) -> float:
    """Return the distance from a filled polygon, shape (k, 2), to the nearest segment or filled circle.

    0 means contact.
    """
    nearest = math.inf
    j = polygon_m.shape[0] - 1
    for i in range(polygon_m.shape[0]):
        edge = WallSegment(polygon_m[j, 0], polygon_m[j, 1], polygon_m[i, 0], polygon_m[i, 1])
        for k in range(segments_m.shape[0]):
            wall = WallSegment(segments_m[k, 0], segments_m[k, 1], segments_m[k, 2], segments_m[k, 3])
            if segments_cross(edge, wall):
                return 0.0
            nearest = min(
                nearest,
                point_segment_m(edge.ax, edge.ay, wall),
                point_segment_m(wall.ax, wall.ay, edge),
                point_segment_m(wall.bx, wall.by, edge),
            )
        for k in range(circles_m.shape[0]):
            centre_m = point_segment_m(circles_m[k, 0], circles_m[k, 1], edge)
            nearest = min(nearest, max(centre_m - circles_m[k, 2], 0.0))
        j = i
    # A shape wholly inside the polygon touches none of its edges.
    for k in range(segments_m.shape[0]):
        if inside_polygon(segments_m[k, 0], segments_m[k, 1], polygon_m):
            return 0.0
    for k in range(circles_m.shape[0]):
        if inside_polygon(circles_m[k, 0], circles_m[k, 1], polygon_m):
            return 0.0
    return nearest


@kernel
def mark_touched(
    geometry: GridGeometry, segments_m: FloatArray, circles_m: FloatArray, touched: BoolArray
) -> None:
    """Set each cell of `touched`, shape (rows, columns), row 0 at `y_lo_m`, whose square contains a shape."""
    for k in range(segments_m.shape[0]):
        ax, ay, bx, by = segments_m[k]
        box = (min(ax, bx), min(ay, by), max(ax, bx), max(ay, by))
        _mark_in_box(geometry, box, segments_m[k : k + 1], circles_m[:0], touched)
    for k in range(circles_m.shape[0]):
        x, y, radius = circles_m[k]
        box = (x - radius, y - radius, x + radius, y + radius)
        _mark_in_box(geometry, box, segments_m[:0], circles_m[k : k + 1], touched)


@kernel
def _mark_in_box(
    geometry: GridGeometry,
    box_m: tuple[float, float, float, float],
    segments_m: FloatArray,
    circles_m: FloatArray,
    touched: BoolArray,
) -> None:
    """Set the cells in and beside the box (lowest x, y, highest x, y) that contain a shape."""
    resolution_m, x_lo_m, y_lo_m = geometry
    # The margin assigns a wall on the line between two cells to both, whatever the rounding.
    half = 0.5 * resolution_m + 1e-9
    first_row = max(math.floor((box_m[1] - y_lo_m) / resolution_m) - 1, 0)
    last_row = min(math.floor((box_m[3] - y_lo_m) / resolution_m) + 1, touched.shape[0] - 1)
    first_column = max(math.floor((box_m[0] - x_lo_m) / resolution_m) - 1, 0)
    last_column = min(math.floor((box_m[2] - x_lo_m) / resolution_m) + 1, touched.shape[1] - 1)
    cell = np.empty((4, 2))
    for row in range(first_row, last_row + 1):
        y = y_lo_m + (row + 0.5) * resolution_m
        for column in range(first_column, last_column + 1):
            if touched[row, column]:
                continue
            x = x_lo_m + (column + 0.5) * resolution_m
            cell[0, 0], cell[1, 0], cell[2, 0], cell[3, 0] = x - half, x + half, x + half, x - half
            cell[0, 1], cell[1, 1], cell[2, 1], cell[3, 1] = y - half, y - half, y + half, y + half
            touched[row, column] = polygon_clearance_m(cell, segments_m, circles_m) <= 0.0


@kernel
def mark_inside(geometry: GridGeometry, polygon_m: FloatArray, touched: BoolArray) -> None:
    """Set each cell of `touched`, shape (rows, columns), whose centre is in the polygon, shape (k, 2)."""
    resolution_m, x_lo_m, y_lo_m = geometry
    for row in range(touched.shape[0]):
        for column in range(touched.shape[1]):
            x, y = x_lo_m + (column + 0.5) * resolution_m, y_lo_m + (row + 0.5) * resolution_m
            if inside_polygon(x, y, polygon_m):
                touched[row, column] = True
