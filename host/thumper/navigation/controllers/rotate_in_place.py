"""Rotate in place, without the corners touching anything."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt

from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.dwa_kernels import FREE, FRONT_M, first_contact
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.footprint_collision import CollisionGrid, lethal_count
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.polyline import index_at
from thumper.navigation.speed_limits import SpeedLimits, step_toward, stoppable_speed

SLOWEST_TURN_RAD_S = 0.25  # a skid-steered base sticks below this
SWEEP_STEP_RAD = 0.05
SWEEP_STEP_M = 0.02
SHORTEST_PATH_M = 0.05  # a path shorter than this has no direction


@dataclass(frozen=True, slots=True, kw_only=True)
class RotateInPlaceOptions:
    """When the robot rotates in place toward its path before it drives on."""

    # Angle between heading and path beyond which it starts [rad]. Pure pursuit uses 0.8 rad and 0.2 rad.
    turn_start_rad: Annotated[float, Gt(0)] = 1.0
    # Angle below which it drives on [rad].
    turn_end_rad: Annotated[float, Gt(0)] = 0.25


def poses_are_free(
    costmap: Costmap, footprint: Footprint, poses: FloatArray, start: Pose2, *, unknown_blocks: bool
) -> bool:
    """Return whether the footprint passes all poses, shape (n, 3), touching no more than at `start`."""
    grid = CollisionGrid.from_costmap(costmap, footprint)
    touching = lethal_count(grid, False, start.x_m, start.y_m, start.theta_rad)
    status, _ = first_contact(poses, grid, unknown_blocks, max(0, touching))
    return status == FREE


def turn_poses(start: Pose2, angle_rad: float) -> FloatArray:
    """Return the poses of a rotation in place, shape (n, 3)."""
    count = max(1, math.ceil(abs(angle_rad) / SWEEP_STEP_RAD))
    headings_rad = start.theta_rad + angle_rad * np.arange(1, count + 1) / count
    return np.column_stack((np.full(count, start.x_m), np.full(count, start.y_m), headings_rad))


def straight_poses(start: Pose2, distance_m: float) -> FloatArray:
    """Return the poses of a straight move, backward if negative, shape (n, 3)."""
    count = max(1, math.ceil(abs(distance_m) / SWEEP_STEP_M))
    along_m = distance_m * np.arange(1, count + 1) / count
    return np.column_stack(
        (
            start.x_m + along_m * math.cos(start.theta_rad),
            start.y_m + along_m * math.sin(start.theta_rad),
            np.full(count, start.theta_rad),
        )
    )


def angle_to_path(path_ahead_m: FloatArray, map_from_base: Pose2) -> float:
    """Return the angle from the heading to a path, shape (n, 2) [m], that starts beside the robot.

    0 if too little of the path is left.
    """
    point_m = path_ahead_m[index_at(path_ahead_m, FRONT_M)]
    dx_m, dy_m = point_m - (map_from_base.x_m, map_from_base.y_m)
    if math.hypot(dx_m, dy_m) < SHORTEST_PATH_M:
        return 0.0
    return wrap_angle(math.atan2(dy_m, dx_m) - map_from_base.theta_rad)


class RotateInPlace:
    """Rotates by the smaller angle if that is free, else by the larger; keeps its side."""

    def __init__(self, limits: SpeedLimits, footprint: Footprint) -> None:
        self._limits = limits
        self._footprint = footprint
        self._side = 0.0

    def reset(self) -> None:
        """Forget the side."""
        self._side = 0.0

    def compute_command(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a rotation by `angle_rad`, or None if neither direction is free."""
        angles_rad = [angle_rad, angle_rad - math.copysign(math.tau, angle_rad)]
        if self._side and abs(angle_rad) > 0.5 * math.pi:
            angles_rad.sort(key=lambda candidate_rad: candidate_rad * self._side < 0.0)
        base = request.map_from_base
        for candidate_rad in angles_rad:
            poses = turn_poses(base, candidate_rad)
            if poses_are_free(request.costmap, self._footprint, poses, base, unknown_blocks=False):
                self._side = math.copysign(1.0, candidate_rad)
                command = self._twist(request, candidate_rad)
                return ControlResult(command=command, rotating=True, trajectory=poses)
        return ControlResult(
            command=None, reason="a rotation in place would hit an obstacle in either direction"
        )

    def _twist(self, request: ControlRequest, angle_rad: float) -> Twist2:
        limits, last = self._limits, request.last_command
        v_m_s = step_toward(last.v_m_s, 0.0, limits.v_accel_m_s2 * request.period_s)
        speed = stoppable_speed(abs(angle_rad), limits.w_accel_rad_s2, limits.latency_s)
        speed = min(max(speed, SLOWEST_TURN_RAD_S), limits.w_max_rad_s)
        change = limits.w_accel_rad_s2 * request.period_s
        w_rad_s = step_toward(last.w_rad_s, math.copysign(speed, angle_rad), change)
        return Twist2(v_m_s=v_m_s, w_rad_s=w_rad_s)


class RotationShim:
    """Rotates the robot toward its path before the controller takes over (Nav2's rotation shim)."""

    def __init__(self, options: RotateInPlaceOptions, limits: SpeedLimits, footprint: Footprint) -> None:
        self._options = options
        self._rotate = RotateInPlace(limits, footprint)
        self._rotating = False

    def reset(self) -> None:
        """Forget that a rotation was under way."""
        self._rotating = False
        self._rotate.reset()

    def rotate(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a rotation in place, whatever the path."""
        return self._rotate.compute_command(request, angle_rad)

    def toward(
        self, request: ControlRequest, angle_rad: float, *, enabled: bool = True
    ) -> ControlResult | None:
        """Return the next twist toward a path at `angle_rad`; None to drive on, or if it is not free."""
        limit_rad = self._options.turn_end_rad if self._rotating else self._options.turn_start_rad
        self._rotating = enabled and abs(angle_rad) > limit_rad
        if not self._rotating:
            self._rotate.reset()
            return None
        result = self._rotate.compute_command(request, angle_rad)
        return None if result.command is None else result
