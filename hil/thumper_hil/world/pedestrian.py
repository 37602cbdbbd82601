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
    """A person who walks along waypoints, shape (n, 2), back and forth, or once if not `returns`.

    The lidar sees a circle, which stops before it walks into the robot. With a `leg_radius_m` above 0 it sees
    two legs; the person does not stop for the robot, but turns back where a leg has walked into it.
    """

    waypoints_m: FloatArray
    speed_m_s: float
    radius_m: float
    leg_radius_m: float = 0.0
    from_s: float
    returns: bool = True
