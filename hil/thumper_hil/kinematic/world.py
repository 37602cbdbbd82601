"""A 2D world of walls and posts for closed-loop tests, with exact rays and exact footprint clearance."""

import math
from dataclasses import dataclass, field

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.numba_kernel import kernel
from thumper.navigation.footprint import Footprint


@kernel
def cast_rays(
    segments_m: FloatArray,
    circles_m: FloatArray,
    x_m: float,
    y_m: float,
    angles_rad: FloatArray,
    far_m: float,
) -> FloatArray:
    """Return the distance to the first hit of each ray, shape as `angles_rad`; inf beyond `far_m`."""
    ranges_m = np.empty(angles_rad.size)
    for i in range(angles_rad.size):
        ux, uy = math.cos(angles_rad[i]), math.sin(angles_rad[i])
        best = np.inf
        for x0, y0, x1, y1 in segments_m:
            ex, ey = x1 - x0, y1 - y0
            across = ux * ey - uy * ex
            if across == 0.0:
                continue
            along = ((x0 - x_m) * ey - (y0 - y_m) * ex) / across
            part = ((x0 - x_m) * uy - (y0 - y_m) * ux) / across
            if along > 0.0 and 0.0 <= part <= 1.0:
                best = min(best, along)
        for cx, cy, radius in circles_m:
            dx, dy = cx - x_m, cy - y_m
            along = dx * ux + dy * uy
            inside = radius * radius - (dx * dx + dy * dy - along * along)
            if inside >= 0.0 and along > 0.0:
                best = min(best, along - math.sqrt(inside))
        ranges_m[i] = best if best <= far_m else np.inf
    return ranges_m


def box(x_m: float, y_m: float, length_m: float, width_m: float, yaw_rad: float = 0.0) -> list[list[float]]:
    """Return the four walls of a rectangle around (x, y)."""
    corners = np.array(((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))) * (length_m, width_m)
    corners = Pose2(x_m=x_m, y_m=y_m, theta_rad=yaw_rad).apply(corners)
    return [[*corners[i - 1].tolist(), *corners[i].tolist()] for i in range(4)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KinematicWorld:
    """Walls (x0, y0, x1, y1) and posts (x, y, radius) [m]."""

    segments_m: FloatArray = field(default_factory=lambda: np.empty((0, 4)))
    circles_m: FloatArray = field(default_factory=lambda: np.empty((0, 3)))

    @classmethod
    def from_boxes(cls, *boxes: list[list[float]]) -> "KinematicWorld":
        """Return a world of boxes."""
        return cls(segments_m=np.array([wall for walls in boxes for wall in walls], dtype=np.float64))

    def with_boxes(self, *boxes: list[list[float]]) -> "KinematicWorld":
        """Return this world with additional boxes."""
        added = KinematicWorld.from_boxes(*boxes).segments_m
        return KinematicWorld(segments_m=np.vstack((self.segments_m, added)), circles_m=self.circles_m)

    def cast(self, pose: Pose2, angles_rad: FloatArray, far_m: float) -> FloatArray:
        """Return the ranges of a lidar at `pose`, with beams at `angles_rad` in its frame."""
        return cast_rays(
            self.segments_m, self.circles_m, pose.x_m, pose.y_m, pose.theta_rad + angles_rad, far_m
        )

    def clearance_m(self, pose: Pose2, footprint: Footprint) -> float:
        """Return the distance from the footprint to the nearest obstacle, negative inside it.

        Walls are sampled every centimetre.
        """
        points, radii = [self.circles_m[:, :2]], [self.circles_m[:, 2]]
        for x0, y0, x1, y1 in self.segments_m:
            count = max(2, math.ceil(math.hypot(x1 - x0, y1 - y0) / 0.01))
            t = np.linspace(0.0, 1.0, count)
            points.append(np.column_stack((x0 + t * (x1 - x0), y0 + t * (y1 - y0))))
            radii.append(np.zeros(count))
        in_base, radius_m = pose.inverse().apply(np.concatenate(points)), np.concatenate(radii)
        from_centre_m = np.hypot(*in_base.T) - radius_m
        margin_m = footprint.circumscribed_radius_m - footprint.inscribed_radius_m
        near = from_centre_m <= from_centre_m.min() + margin_m  # no point beyond can be the nearest
        return float((_distance_outside_m(in_base[near], footprint) - radius_m[near]).min())


def _distance_outside_m(points_m: FloatArray, footprint: Footprint) -> FloatArray:
    polygon = footprint.polygon_m()
    nearest_m = np.full(len(points_m), np.inf)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        t = np.clip((points_m - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        nearest_m = np.minimum(nearest_m, np.hypot(*(points_m - a - t[:, None] * (b - a)).T))
    planes = footprint.half_planes()
    inside = (points_m @ planes[:, :2].T < planes[:, 2]).all(axis=1)
    return np.where(inside, -nearest_m, nearest_m)
