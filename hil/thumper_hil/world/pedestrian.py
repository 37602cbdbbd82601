"""What a world holds only for a while, and who walks in it: plain descriptions."""

import math
from dataclasses import dataclass

from thumper.common.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Timed:
    """A box (x, y, length, width, yaw_deg) or a circle (x, y, radius), there for a time."""

    from_s: float = 0.0
    until_s: float = math.inf
    box: tuple[float, float, float, float, float] | None = None
    circle: tuple[float, float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pedestrian:
    """A person as the lidar sees one: a circle that walks its waypoints, shape (n, 2), to and fro."""

    waypoints_m: FloatArray
    speed_m_s: float
    radius_m: float
    from_s: float
