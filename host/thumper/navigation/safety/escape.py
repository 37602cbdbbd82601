"""Frees a robot whose wanted motion is refused: of a few slow motions that the collision monitor allows, the
one that gains the most room or, where none does, that passes by.

A controller that is refused beside a post asks for the same bend again and again. To drive straight on until
the post is behind, or to turn away from it first, is not what it scores.
"""

import math

import numpy as np

from thumper.common.geometry import FloatArray, Twist2
from thumper.common.numba_kernel import kernel
from thumper.navigation.controllers.controller import ControlRequest
from thumper.navigation.controllers.rotate_in_place import is_open
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.polyline import arc_lengths, nearest_index
from thumper.navigation.safety.collision_monitor import CollisionMonitor
from thumper.navigation.safety.velocity_smoother import smooth_velocity
from thumper.navigation.speed_limits import SpeedLimits

SPEEDS_M_S, TURNS_RAD_S = (0.08, 0.0, -0.06), (0.0, 0.15, -0.15, 0.4, -0.4)
AHEAD_S, STEP_S = 0.8, 0.1
ENOUGH_M = 0.04  # room beyond this is worth nothing more
AIM_M = 0.3  # along the path ...
PROGRESS_PART = 0.15  # ... and a metre nearer to there is worth as much as this many metres of room
LEAST_GAIN_M = 0.001


@kernel
def room(points_m: FloatArray, half_planes: FloatArray, pose: FloatArray) -> float:
    """Least distance of points, shape (n, 2), from the outline at a pose (x, y, theta); negative inside.

    Off a corner it is the distance from the further edge's line, which is less.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    least = np.inf
    for i in range(points_m.shape[0]):
        dx, dy = points_m[i, 0] - pose[0], points_m[i, 1] - pose[1]
        bx, by = cos * dx + sin * dy, -sin * dx + cos * dy
        outside = -np.inf
        for k in range(half_planes.shape[0]):
            outside = max(outside, half_planes[k, 0] * bx + half_planes[k, 1] * by - half_planes[k, 2])
        least = min(least, outside)
    return least


class Escape:
    """Looks for a way out; the monitor has the last word on it too."""

    def __init__(self, monitor: CollisionMonitor, limits: SpeedLimits, footprint: Footprint) -> None:
        self._monitor = monitor
        self._limits = limits
        self._footprint = footprint
        self._half_planes = footprint.half_planes()
        self._reach_m = footprint.circumscribed_radius_m + 2.0 * ENOUGH_M
        self._motions = [(Twist2(v_m_s=v, w_rad_s=w), _arc(v, w)) for v in SPEEDS_M_S for w in TURNS_RAD_S]

    def command(
        self, request: ControlRequest, hits_in_base_m: FloatArray, spread_m: FloatArray
    ) -> Twist2 | None:
        """Return the next twist, or None when no motion gains anything; hits as the monitor takes them."""
        near = np.hypot(hits_in_base_m[:, 0], hits_in_base_m[:, 1]) <= self._reach_m
        points_m, aim_m = np.ascontiguousarray(hits_in_base_m[near]), _aim(request)
        here_m = self._worth_m(points_m, np.zeros(3), aim_m)
        gains_m = [self._worth_m(points_m, arc[-1], aim_m) - here_m for _, arc in self._motions]
        for index in np.argsort(gains_m)[::-1]:
            if gains_m[index] < LEAST_GAIN_M:
                break
            wanted, arc = self._motions[index]
            if wanted.v_m_s < 0.0 and not self._is_known(request, arc):
                continue
            command = smooth_velocity(wanted, request.last_command, self._limits, request.period_s)
            if not self._monitor.objection(
                command, request.twist, hits_in_base_m, spread_m, request.period_s
            ):
                return command
        return None

    def _worth_m(self, points_m: FloatArray, pose: FloatArray, aim_m: FloatArray) -> float:
        room_m = min(ENOUGH_M, room(points_m, self._half_planes, pose))
        return room_m - PROGRESS_PART * math.dist(pose[:2], aim_m)

    def _is_known(self, request: ControlRequest, arc: FloatArray) -> bool:
        """Whether the ground behind is known and free: the lidar does not see there."""
        base = request.map_from_base
        poses = np.column_stack((base.apply(arc[:, :2]), base.theta_rad + arc[:, 2]))
        return is_open(request.costmap, self._footprint, poses, base, unknown_blocks=True)


def _arc(v_m_s: float, w_rad_s: float) -> FloatArray:
    """Poses of a motion at constant speeds, shape (n, 3), in the frame of its beginning."""
    headings_rad = w_rad_s * STEP_S * np.arange(1, round(AHEAD_S / STEP_S) + 1)
    middles_rad = headings_rad - 0.5 * w_rad_s * STEP_S
    x_m, y_m = (np.cumsum(v_m_s * STEP_S * f(middles_rad)) for f in (np.cos, np.sin))
    return np.column_stack((x_m, y_m, headings_rad))


def _aim(request: ControlRequest) -> FloatArray:
    """A point of the path ahead, in base_link, shape (2,) [m]."""
    base = request.map_from_base
    rest_m = request.path_m[nearest_index(request.path_m, base.x_m, base.y_m) :]
    index = min(int(np.searchsorted(arc_lengths(rest_m), AIM_M)), len(rest_m) - 1)
    point_m: FloatArray = base.inverse().apply(rest_m[index : index + 1])[0]
    return point_m
