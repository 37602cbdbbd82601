"""The last centimetres to a goal beside or behind the robot: rotate toward it, then drive straight.

A path shorter than the pose error has no direction to follow, and a robot that only drives forward would need
a new approach for a centimetre that it has missed.
"""

import math

from thumper.common.geometry import Pose2, Twist2, wrap_angle
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.rotate_in_place import RotateInPlace, poses_are_free, straight_poses
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.speed_limits import SpeedLimits, step_toward

BEGIN_M, END_M = 0.12, 0.20  # it begins nearer to the goal than the first, and ends beyond the second
MISSED_RAD = 1.0  # a goal further off the heading is missed
# The robot rotates in place beyond the first angle, until below the second.
AIM_START_RAD, AIM_END_RAD = 0.5, 0.15
AIM_GAIN = 2.0  # turn rate per heading error while it drives [1/s]


class FinalApproach:
    """Drives straight to the goal, forward or backward, whichever needs the smaller rotation."""

    def __init__(self, limits: SpeedLimits, footprint: Footprint, *, approach_m_s: float) -> None:
        self._limits = limits
        self._footprint = footprint
        self._speed_m_s = approach_m_s
        self._rotate = RotateInPlace(limits, footprint)
        self._active = self._aiming = False

    def reset(self) -> None:
        """End the approach."""
        self._active = self._aiming = False
        self._rotate.reset()

    def compute_command(
        self, request: ControlRequest, goal: Goal, *, missed: bool = False
    ) -> ControlResult | None:
        """Return the next twist; None if the goal is not missed or the straight path is not free.

        With `missed` the goal counts as missed, whatever its direction.
        """
        base, limits, period_s = request.map_from_base, self._limits, request.period_s
        distance_m = goal.distance_m(base)
        bearing_rad = wrap_angle(math.atan2(goal.y_m - base.y_m, goal.x_m - base.x_m) - base.theta_rad)
        if distance_m > (END_M if self._active else BEGIN_M):
            self.reset()
            return None
        if not (self._active or missed) and abs(bearing_rad) < MISSED_RAD:
            return None
        self._active = True
        forward = abs(bearing_rad) <= 0.5 * math.pi
        error_rad = bearing_rad if forward else wrap_angle(bearing_rad + math.pi)
        aimed = Pose2(x_m=base.x_m, y_m=base.y_m, theta_rad=base.theta_rad + error_rad)
        poses = straight_poses(aimed, distance_m if forward else -distance_m)
        if not poses_are_free(request.costmap, self._footprint, poses, base, unknown_blocks=not forward):
            return None
        self._aiming = abs(error_rad) > (AIM_END_RAD if self._aiming else AIM_START_RAD)
        if self._aiming:
            rotation = self._rotate.compute_command(request, error_rad)
            return None if rotation.command is None else rotation
        last = request.last_command
        v_m_s = math.copysign(self._speed_m_s, 1.0 if forward else -1.0)
        command = Twist2(
            v_m_s=step_toward(last.v_m_s, v_m_s, limits.v_accel_m_s2 * period_s),
            w_rad_s=step_toward(last.w_rad_s, AIM_GAIN * error_rad, limits.w_accel_rad_s2 * period_s),
        )
        return ControlResult(command=command, trajectory=poses)
