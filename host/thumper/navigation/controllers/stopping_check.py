"""Whether one twist leaves the robot room to stop: the admissibility of the dynamic window for a single
command.
"""

import math

import numpy as np

from thumper.common.geometry import FloatArray, Twist2
from thumper.navigation.controllers.controller import ControlRequest
from thumper.navigation.controllers.dwa_kernels import simulate
from thumper.navigation.controllers.rotate_in_place import is_open
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits

STEP_S = 0.05


class AdmissibilityCheck:
    """Drives a command in thought until the robot could stand again."""

    def __init__(self, limits: SpeedLimits, footprint: Footprint) -> None:
        self._limits = limits
        self._footprint = footprint

    def refusal(self, request: ControlRequest, command: Twist2) -> tuple[str, FloatArray]:
        """Return what is wrong with the command or an empty string, and its poses, shape (n, 3)."""
        limits, base, twist = self._limits, request.map_from_base, request.twist
        # Braking at constant deceleration takes half the way that driving on would.
        braking_s = 0.5 * max(
            abs(command.v_m_s) / limits.v_accel_m_s2, abs(command.w_rad_s) / limits.w_accel_rad_s2
        )
        fastest_m_s = max(abs(command.v_m_s), abs(twist.v_m_s), 1e-3)
        step_s = min(STEP_S, request.costmap.resolution_m / fastest_m_s)
        count = math.ceil((limits.latency_s + request.period_s + braking_s) / step_s) + 1
        poses = np.empty((count, 3))
        simulate(
            np.array((base.x_m, base.y_m, base.theta_rad)),
            np.array((twist.v_m_s, twist.w_rad_s)),
            np.array((command.v_m_s, command.w_rad_s)),
            np.array((limits.v_accel_m_s2, limits.w_accel_rad_s2, limits.latency_s, step_s)),
            poses,
        )
        if is_open(request.costmap, self._footprint, poses, base, unknown_blocks=False):
            return "", poses
        return "hits an obstacle before the robot could stop", poses
