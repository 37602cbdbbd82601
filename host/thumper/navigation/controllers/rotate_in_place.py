"""Turn on the spot, without the corners touching anything."""

import math

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.dwa_kernels import OPEN, first_contact
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.footprint_collision import Ground, lethal_count
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits, step_toward, stoppable_speed

SLOWEST_TURN_RAD_S = 0.25  # a skid-steered base sticks below this
SWEEP_STEP_RAD = 0.05
SWEEP_STEP_M = 0.02


def is_open(
    costmap: Costmap, footprint: Footprint, poses: FloatArray, start: Pose2, *, unknown_blocks: bool
) -> bool:
    """Whether the outline can pass through all poses, shape (n, 3), touching no more than at `start`."""
    ground = Ground.of(costmap, footprint)
    touching = lethal_count(ground, False, start.x_m, start.y_m, start.theta_rad)
    status, _ = first_contact(poses, ground, unknown_blocks, max(0, touching))
    return status == OPEN


def turn_poses(start: Pose2, angle_rad: float) -> FloatArray:
    """Poses of a turn on the spot, shape (n, 3)."""
    count = max(1, math.ceil(abs(angle_rad) / SWEEP_STEP_RAD))
    headings_rad = start.theta_rad + angle_rad * np.arange(1, count + 1) / count
    return np.column_stack((np.full(count, start.x_m), np.full(count, start.y_m), headings_rad))


def straight_poses(start: Pose2, distance_m: float) -> FloatArray:
    """Poses of a straight move, backward when negative, shape (n, 3)."""
    count = max(1, math.ceil(abs(distance_m) / SWEEP_STEP_M))
    along_m = distance_m * np.arange(1, count + 1) / count
    return np.column_stack(
        (
            start.x_m + along_m * math.cos(start.theta_rad),
            start.y_m + along_m * math.sin(start.theta_rad),
            np.full(count, start.theta_rad),
        )
    )


class RotateInPlace:
    """Turns the shorter way when it is free, else the longer one, and keeps to the side it began with."""

    def __init__(self, limits: SpeedLimits, footprint: Footprint) -> None:
        self._limits = limits
        self._footprint = footprint
        self._side = 0.0

    def reset(self) -> None:
        """Forget the side."""
        self._side = 0.0

    def command(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a turn by `angle_rad`, or None when neither way round is free."""
        shorter_rad = angle_rad
        longer_rad = angle_rad - math.copysign(math.tau, angle_rad)
        ways = [shorter_rad, longer_rad]
        if self._side and abs(angle_rad) > 0.5 * math.pi:
            ways.sort(key=lambda way_rad: way_rad * self._side < 0.0)
        for way_rad in ways:
            poses = turn_poses(request.map_from_base, way_rad)
            if is_open(request.costmap, self._footprint, poses, request.map_from_base, unknown_blocks=False):
                self._side = math.copysign(1.0, way_rad)
                return ControlResult(command=self._twist(request, way_rad), rotating=True, trajectory=poses)
        return ControlResult(command=None, reason="a turn on the spot would hit an obstacle either way round")

    def _twist(self, request: ControlRequest, way_rad: float) -> Twist2:
        limits, last = self._limits, request.last_command
        v_m_s = step_toward(last.v_m_s, 0.0, limits.v_accel_m_s2 * request.period_s)
        speed = stoppable_speed(abs(way_rad), limits.w_accel_rad_s2, limits.latency_s)
        speed = min(max(speed, SLOWEST_TURN_RAD_S), limits.w_max_rad_s)
        change = limits.w_accel_rad_s2 * request.period_s
        w_rad_s = step_toward(last.w_rad_s, math.copysign(speed, way_rad), change)
        return Twist2(v_m_s=v_m_s, w_rad_s=w_rad_s)
