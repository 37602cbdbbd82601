"""The robot's footprint: its outline on the floor, in base_link. Pure."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray

WILD_THUMPER_M = ((-0.21, -0.15), (0.21, -0.15), (0.21, 0.15), (-0.21, 0.15))


@dataclass(frozen=True, slots=True, kw_only=True)
class Footprint:
    """A convex polygon round the origin of base_link, vertices (x_m, y_m) counter-clockwise.

    Default: the Wild Thumper, 0.42 m long and 0.30 m wide over its tyres, centred.
    """

    vertices_m: tuple[tuple[float, float], ...] = WILD_THUMPER_M  # x, y of each corner, counter-clockwise

    def __post_init__(self) -> None:
        if len(self.vertices_m) < 3:
            raise ValueError(f"footprint needs at least 3 vertices, got {len(self.vertices_m)}")
        polygon = self.polygon_m()
        edges = np.roll(polygon, -1, axis=0) - polygon
        following = np.roll(edges, -1, axis=0)
        turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
        if not (np.isfinite(polygon).all() and (turns > 0.0).all() and self.inscribed_radius_m > 0.0):
            raise ValueError(
                f"footprint must be convex, counter-clockwise and contain base_link, got {self.vertices_m}"
            )

    @classmethod
    def rectangle(cls, *, length_m: float, width_m: float) -> "Footprint":
        """Return a rectangle centred on base_link."""
        x_m, y_m = 0.5 * length_m, 0.5 * width_m
        return cls(vertices_m=((-x_m, -y_m), (x_m, -y_m), (x_m, y_m), (-x_m, y_m)))

    def polygon_m(self) -> FloatArray:
        """Return the vertices, shape (k, 2) [m]."""
        return np.array(self.vertices_m, dtype=np.float64)

    def half_planes(self) -> FloatArray:
        """Return the edges (nx, ny, offset), shape (k, 3): a point is `offset - n . p` metres inside each."""
        polygon = self.polygon_m()
        edges = np.roll(polygon, -1, axis=0) - polygon
        normals = np.stack((edges[:, 1], -edges[:, 0]), axis=1) / np.hypot(edges[:, 0], edges[:, 1])[:, None]
        return np.column_stack((normals, np.sum(normals * polygon, axis=1)))

    def grown(self, padding_m: float) -> "Footprint":
        """Return the polygon with every edge moved outward by `padding_m`."""
        planes = self.half_planes()
        normals, offsets = planes[:, :2], planes[:, 2] + padding_m
        vertices = [np.linalg.solve(normals[[i - 1, i]], offsets[[i - 1, i]]) for i in range(len(planes))]
        return Footprint(vertices_m=tuple((float(x_m), float(y_m)) for x_m, y_m in vertices))

    @property
    def inscribed_radius_m(self) -> float:
        """Radius of the largest disc round base_link inside the outline [m]."""
        return float(self.half_planes()[:, 2].min())

    @property
    def circumscribed_radius_m(self) -> float:
        """Radius of the smallest disc round base_link that contains the outline [m]."""
        return max(math.hypot(x_m, y_m) for x_m, y_m in self.vertices_m)

    def outline_m(self, spacing_m: float) -> FloatArray:
        """Return points along the outline, at most `spacing_m` apart, with all vertices, shape (n, 2) [m]."""
        polygon = self.polygon_m()
        pieces = []
        for start, end in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            count = max(1, math.ceil(math.dist(start, end) / spacing_m))
            pieces.append(start + (end - start) * (np.arange(count) / count)[:, None])
        return np.concatenate(pieces)


def outside_m(points_in_base_m: FloatArray, half_planes: FloatArray) -> FloatArray:
    """Return how far points, shape (n, 2), are outside an outline's edges, shape (n,); inside: below zero.

    `half_planes` are those of `Footprint.half_planes`.
    """
    return np.asarray((points_in_base_m @ half_planes[:, :2].T - half_planes[:, 2]).max(axis=1))
