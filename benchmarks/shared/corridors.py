"""A loop of corridors with doorways, and a drive around it with bad odometry."""

import itertools
import math
from collections.abc import Iterator

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.scan import Scan
from thumper_hil.world.world import World

WIDTH_M = 2.4


def corridor_loop(length_m: float, breadth_m: float, rng: np.random.Generator) -> World:
    """Return a rectangular corridor; doorways of random depth and distance make its places distinct."""
    rows: list[tuple[float, float, float, float]] = []

    def wall(x0: float, y0: float, x1: float, y1: float, nx: float, ny: float) -> None:
        length = math.hypot(x1 - x0, y1 - y0)
        ux, uy, at, (x, y) = (x1 - x0) / length, (y1 - y0) / length, 0.0, (x0, y0)
        while (at := at + float(rng.uniform(2.5, 6.0))) + 1.5 < length:
            deep, wide = float(rng.uniform(0.15, 0.5)), float(rng.uniform(0.8, 1.2))
            a = (x0 + ux * at, y0 + uy * at)
            b = (a[0] + nx * deep, a[1] + ny * deep)
            c, d = (b[0] + ux * wide, b[1] + uy * wide), (a[0] + ux * wide, a[1] + uy * wide)
            rows.extend([(x, y, *a), (*a, *b), (*b, *c), (*c, *d)])
            (x, y), at = d, at + wide
        rows.append((x, y, x1, y1))

    w, h, i = length_m, breadth_m, WIDTH_M
    for ends in ((0, 0, w, 0, 0, -1), (w, 0, w, h, 1, 0), (w, h, 0, h, 0, 1), (0, h, 0, 0, -1, 0)):
        wall(*ends)
    for x0, y0, x1, y1, nx, ny in (
        (i, i, w - i, i, 0, 1),
        (w - i, i, w - i, h - i, -1, 0),
        (w - i, h - i, i, h - i, 0, -1),
        (i, h - i, i, i, 1, 0),
    ):
        wall(x0, y0, x1, y1, nx, ny)
    return World(segments_m=np.array(rows), circles_m=np.zeros((0, 3)))


def round_trip(length_m: float, breadth_m: float, beyond_m: float, step_m: float = 0.2) -> list[Pose2]:
    """Return poses along the middle of the corridors, once around and `beyond_m` further."""
    c, r = 0.5 * WIDTH_M, 0.6
    corners = [(c, c), (length_m - c, c), (length_m - c, breadth_m - c), (c, breadth_m - c), (c, c)]
    poses: list[Pose2] = []
    for k, ((x0, y0), (x1, y1)) in enumerate(itertools.pairwise(corners)):
        heading = k * math.pi / 2.0
        length = math.hypot(x1 - x0, y1 - y0)
        for along in np.arange(r, length - r, step_m):
            poses.append(
                Pose2(
                    x_m=x0 + along * math.cos(heading), y_m=y0 + along * math.sin(heading), theta_rad=heading
                )
            )
        poses.extend(poses[-1] @ Pose2(x_m=0.1, y_m=0.01, theta_rad=t) for t in (0.4, 0.8, 1.2))
    return poses + poses[: round(beyond_m / step_m)]


def drive(
    world: World, poses: list[Pose2], rng: np.random.Generator, bias_rad_per_m: float = 0.004
) -> Iterator[tuple[Pose2, Scan]]:
    """Yield odometry that reads 1 % long and veers off, with noise, and scans over 180 degrees up to 20 m."""
    odometry, angles = Pose2(), np.linspace(-0.5 * math.pi, 0.5 * math.pi, 121)
    for before, pose in zip([poses[0], *poses[:-1]], poses, strict=True):
        step = before.inverse() @ pose
        distance_m = math.hypot(step.x_m, step.y_m)
        noise = rng.standard_normal(2) * math.sqrt(distance_m)
        odometry = odometry @ Pose2(
            x_m=1.01 * step.x_m + 0.01 * noise[0],
            y_m=step.y_m,
            theta_rad=1.03 * step.theta_rad + bias_rad_per_m * distance_m + 0.01 * noise[1],
        )
        ranges_m = world.cast(pose.x_m, pose.y_m, pose.theta_rad + angles)
        ranges_m = ranges_m + 0.01 * rng.standard_normal(ranges_m.size)
        yield (
            odometry,
            Scan(
                time_s=0.0,
                ranges_m=np.where(ranges_m < 20.0, ranges_m, np.nan),
                angle_min_rad=-0.5 * math.pi,
                angle_increment_rad=math.pi / 120,
                range_max_m=20.0,
            ),
        )


def errors_m(path: FloatArray, poses: list[Pose2]) -> FloatArray:
    """Return the distance of each pose from the truth, shape (n,)."""
    truth = np.array([(pose.x_m, pose.y_m) for pose in poses])
    return np.asarray(np.hypot(*(path[:, :2] - truth).T))
