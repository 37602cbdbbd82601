"""An AprilTag on a wall of a world."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class TagShape:
    """An upright tag of the family 36h11; `size_m` is the edge of its black square."""

    number: int
    x_m: float  # centre
    y_m: float
    z_m: float  # above the floor
    yaw_deg: float  # where it faces
    size_m: float

    def normal(self) -> FloatArray:
        """Return the direction it faces, shape (3,)."""
        yaw_rad = math.radians(self.yaw_deg)
        return np.array([math.cos(yaw_rad), math.sin(yaw_rad), 0.0])

    def centre_m(self) -> FloatArray:
        """Return the centre, shape (3,)."""
        return np.array([self.x_m, self.y_m, self.z_m])

    def corners_m(self, edge_m: float) -> FloatArray:
        """Return the corners of a square with that edge, shape (4, 3), clockwise from the top left."""
        yaw_rad = math.radians(self.yaw_deg)
        right = 0.5 * edge_m * np.array([-math.sin(yaw_rad), math.cos(yaw_rad), 0.0])
        up = np.array([0.0, 0.0, 0.5 * edge_m])
        offsets_m = np.array([up - right, up + right, right - up, -up - right], np.float64)
        return np.asarray(self.centre_m() + offsets_m, np.float64)
