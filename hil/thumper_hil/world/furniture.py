"""Tables and chairs: thin legs that the lidar sees, and a top above or below its plane."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray, Pose2

ROBOT_HEIGHT_M = 0.25
"""Top of the lidar: a table whose top is lower blocks the robot."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Furniture:
    """A table or chair with four legs; `clearance_m` is the height of its top's lower side."""

    x_m: float
    y_m: float
    length_m: float
    width_m: float
    yaw_deg: float = 0.0
    leg_radius_m: float = 0.02
    clearance_m: float = 0.7

    def legs_m(self) -> FloatArray:
        """Return the legs as circles, shape (4, 3): x y radius."""
        corners_m = self._corners_m(self.leg_radius_m)
        return np.column_stack([corners_m, np.full(4, self.leg_radius_m)])

    def edges_m(self) -> FloatArray:
        """Return the sides of a top that blocks the robot, shape (4, 4), else shape (0, 4)."""
        if self.clearance_m >= ROBOT_HEIGHT_M:
            return np.zeros((0, 4))
        corners_m = self._corners_m(0.0)
        return np.column_stack([corners_m, np.roll(corners_m, -1, axis=0)])

    def _corners_m(self, inset_m: float) -> FloatArray:
        half = 0.5 * np.array([self.length_m, self.width_m]) - inset_m
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        return Pose2(x_m=self.x_m, y_m=self.y_m, theta_rad=math.radians(self.yaw_deg)).apply(corners)
