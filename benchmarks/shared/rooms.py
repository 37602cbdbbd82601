"""Synthetic rooms with a closed-form lidar, for the SLAM tests."""

import math

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.scan import Scan


def rectangle(x0: float, y0: float, x1: float, y1: float) -> FloatArray:
    """Return four walls, rows x0 y0 x1 y1."""
    return np.array([[x0, y0, x1, y0], [x1, y0, x1, y1], [x1, y1, x0, y1], [x0, y1, x0, y0]])


# An asymmetric room: 5 x 4 m, a cupboard and a pillar.
ROOM = np.concatenate(
    (rectangle(-2.0, -1.5, 3.0, 2.5), rectangle(1.8, 1.6, 3.0, 2.5), rectangle(-1.2, -0.9, -0.9, -0.6))
)


def cast(walls: FloatArray, x_m: float, y_m: float, angle_rad: float) -> float:
    """Return the distance to the first wall along a ray; inf if there is none."""
    direction = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    start, edge = walls[:, :2] - (x_m, y_m), walls[:, 2:] - walls[:, :2]
    cross = direction[0] * edge[:, 1] - direction[1] * edge[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (start[:, 0] * edge[:, 1] - start[:, 1] * edge[:, 0]) / cross
        across = (start[:, 0] * direction[1] - start[:, 1] * direction[0]) / cross
    seen = (cross != 0.0) & (along > 0.0) & (across >= 0.0) & (across <= 1.0)
    return float(along[seen].min()) if seen.any() else math.inf


def room_scan(
    map_from_laser: Pose2,
    *,
    walls: FloatArray = ROOM,
    beams: int = 360,
    first_rad: float = -math.pi,
    step_rad: float = math.tau / 360,
    noise_m: float = 0.0,
    rng: np.random.Generator | None = None,
) -> Scan:
    """Return the scan of a lidar at the pose, with Gaussian range noise."""
    angles_rad = first_rad + step_rad * np.arange(beams)
    ranges_m = np.array(
        [
            cast(walls, map_from_laser.x_m, map_from_laser.y_m, map_from_laser.theta_rad + a)
            for a in angles_rad
        ]
    )
    if rng is not None:
        ranges_m = ranges_m + noise_m * rng.standard_normal(beams)
    return Scan(
        time_s=0.0,
        ranges_m=ranges_m,
        angle_min_rad=first_rad,
        angle_increment_rad=step_rad,
        range_max_m=30.0,
    )
