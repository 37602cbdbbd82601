"""Descriptions of timed obstacles and pedestrians in a world."""

import math
from dataclasses import dataclass

from thumper.common.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class TimedObstacle:
    """A box (x, y, length, width, yaw_deg) or a circle (x, y, radius) that exists for a limited time."""

    from_s: float = 0.0
    until_s: float = math.inf
    box: tuple[float, float, float, float, float] | None = None
    circle: tuple[float, float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pedestrian:
    """A person as the lidar sees one: a circle that walks back and forth along waypoints, shape (n, 2)."""

    waypoints_m: FloatArray
    speed_m_s: float
    radius_m: float
    from_s: float
