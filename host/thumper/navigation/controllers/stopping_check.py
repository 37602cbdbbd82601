"""Check whether a twist leaves the robot room to stop: DWA's admissible velocity for one command."""

import math
from collections.abc import Iterable

import numpy as np

from thumper.common.geometry import FloatArray, Twist2
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.dwa_kernels import Dynamics, MotionStart, simulate
from thumper.navigation.controllers.rotate_in_place import poses_are_free
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits

STEP_S = 0.05


def motion_start(request: ControlRequest) -> MotionStart:
    """Return pose and measured twist of the robot."""
    base, twist = request.map_from_base, request.twist
    return MotionStart(x=base.x_m, y=base.y_m, theta=base.theta_rad, v=twist.v_m_s, w=twist.w_rad_s)


def dynamics_of(limits: SpeedLimits, step_s: float) -> Dynamics:
    """Return the accelerations and the latency of the base."""
    return Dynamics(
        v_accel=limits.v_accel_m_s2,
        w_accel=limits.w_accel_rad_s2,
        latency_s=limits.latency_s,
        step_s=step_s,
    )


def braking_distance_s(command: Twist2, limits: SpeedLimits) -> float:
    """Return how long the robot would drive at constant speed to cover its braking distance [s].

    Braking at constant deceleration takes half the distance that driving on for the same time would.
    """
    return 0.5 * max(abs(command.v_m_s) / limits.v_accel_m_s2, abs(command.w_rad_s) / limits.w_accel_rad_s2)


def simulated_poses(
    request: ControlRequest, command: Twist2, limits: SpeedLimits, *, step_s: float, count: int
) -> FloatArray:
    """Return the next poses of the robot under a command, shape (count, 3)."""
    poses = np.empty((count, 3))
    twist = np.array((command.v_m_s, command.w_rad_s))
    simulate(motion_start(request), twist, dynamics_of(limits, step_s), poses)
    return poses


class AdmissibilityCheck:
    """Simulates commands until the robot could have stopped."""

    def __init__(self, limits: SpeedLimits, footprint: Footprint) -> None:
        self._limits = limits
        self._footprint = footprint

    def first_admissible(
        self, request: ControlRequest, candidates: Iterable[Twist2], what: str
    ) -> ControlResult:
        """Return the first command that leaves room to stop; None if none does. `what` names the motion."""
        for command in candidates:
            poses = self._stopping_poses(request, command)
            base = request.map_from_base
            if poses_are_free(request.costmap, self._footprint, poses, base, unknown_blocks=False):
                return ControlResult(command=command, trajectory=poses)
        return ControlResult(command=None, reason=f"{what} would hit an obstacle before the robot could stop")

    def _stopping_poses(self, request: ControlRequest, command: Twist2) -> FloatArray:
        limits = self._limits
        fastest_m_s = max(abs(command.v_m_s), abs(request.twist.v_m_s), 1e-3)
        step_s = min(STEP_S, request.costmap.resolution_m / fastest_m_s)
        driven_s = limits.latency_s + request.period_s + braking_distance_s(command, limits)
        return simulated_poses(
            request, command, limits, step_s=step_s, count=math.ceil(driven_s / step_s) + 1
        )
