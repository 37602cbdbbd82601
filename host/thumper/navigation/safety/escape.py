"""Escape: replace a rejected motion by one of a few slow ones that the collision monitor allows.

It takes the one that gains the most room or, where none does, the one that gets past the obstacle. A
controller that is rejected beside a post requests the same bend again and again. Its scores do not favour
driving straight until the post is behind, or turning away from it first. Where the path leads back, room to
turn on the spot counts, too.
"""

import math

import numpy as np

from thumper.common.geometry import FloatArray, Twist2
from thumper.common.numba_kernel import kernel
from thumper.navigation.controllers.controller import ControlRequest
from thumper.navigation.controllers.rotate_in_place import poses_are_free
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.polyline import ahead
from thumper.navigation.safety.collision_monitor import CollisionMonitor
from thumper.navigation.safety.velocity_smoother import smooth_velocity
from thumper.navigation.speed_limits import SpeedLimits

SPEEDS_M_S, TURNS_RAD_S = (0.08, 0.0, -0.06), (0.0, 0.15, -0.15, 0.4, -0.4)
DURATION_S, STEP_S = 0.8, 0.1
ENOUGH_M = 0.04  # more room than this counts no more
LOOKAHEAD_M = 0.3  # of the target point on the path ...
PROGRESS_WEIGHT = 0.15  # ... and the room that one metre nearer to it is worth [m/m]
LEAST_GAIN_M = 0.001


@kernel
def room(points_m: FloatArray, half_planes: FloatArray, pose: FloatArray) -> float:
    """Return the least distance of points, shape (n, 2), from the outline at a pose (x, y, theta).

    Negative inside. Beyond a corner it is the distance from the further edge's line, which is less.
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
    """Searches for a motion that gains room and that the collision monitor allows."""

    def __init__(self, monitor: CollisionMonitor, limits: SpeedLimits, footprint: Footprint) -> None:
        self._monitor = monitor
        self._limits = limits
        self._footprint = footprint
        self._half_planes = footprint.half_planes()
        self._near_m = footprint.circumscribed_radius_m + 2.0 * ENOUGH_M
        self._motions = [(Twist2(v_m_s=v, w_rad_s=w), _arc(v, w)) for v in SPEEDS_M_S for w in TURNS_RAD_S]

    def compute_command(
        self, request: ControlRequest, hits_in_base_m: FloatArray, position_error_m: FloatArray
    ) -> Twist2 | None:
        """Return the next twist, or None if no motion gains anything; hits as the monitor takes them."""
        near = np.hypot(hits_in_base_m[:, 0], hits_in_base_m[:, 1]) <= self._near_m
        points_m, target_m = np.ascontiguousarray(hits_in_base_m[near]), _target(request)
        here_m = self._value_m(points_m, np.zeros(3), target_m)
        gains_m = [self._value_m(points_m, arc[-1], target_m) - here_m for _, arc in self._motions]
        for index in np.argsort(gains_m)[::-1]:
            if gains_m[index] < LEAST_GAIN_M:
                break
            wanted, arc = self._motions[index]
            if wanted.v_m_s < 0.0 and not self._is_known(request, arc):
                continue
            command = smooth_velocity(wanted, request.last_command, self._limits, request.period_s)
            stop = self._monitor.stop_reason(
                command, request.twist, hits_in_base_m, position_error_m, request.period_s
            )
            if stop is None:
                return command
        return None

    def _value_m(self, points_m: FloatArray, pose: FloatArray, target_m: FloatArray) -> float:
        room_m = min(ENOUGH_M, room(points_m, self._half_planes, pose))
        if len(points_m) and target_m[0] < 0.0:  # the path begins with a turn on the spot
            nearest_m = float(np.hypot(*(points_m - pose[:2]).T).min())
            room_m += min(2.0 * ENOUGH_M, nearest_m - self._footprint.circumscribed_radius_m)
        return room_m - PROGRESS_WEIGHT * math.dist(pose[:2], target_m)

    def _is_known(self, request: ControlRequest, arc: FloatArray) -> bool:
        """Return whether the space behind is known and free: the lidar does not see there."""
        base = request.map_from_base
        poses = np.column_stack((base.apply(arc[:, :2]), base.theta_rad + arc[:, 2]))
        return poses_are_free(request.costmap, self._footprint, poses, base, unknown_blocks=True)


def _arc(v_m_s: float, w_rad_s: float) -> FloatArray:
    """Return the poses of a motion at constant speeds, shape (n, 3), in the frame of its start."""
    headings_rad = w_rad_s * STEP_S * np.arange(1, round(DURATION_S / STEP_S) + 1)
    means_rad = headings_rad - 0.5 * w_rad_s * STEP_S
    x_m, y_m = (np.cumsum(v_m_s * STEP_S * f(means_rad)) for f in (np.cos, np.sin))
    return np.column_stack((x_m, y_m, headings_rad))


def _target(request: ControlRequest) -> FloatArray:
    """Return a point of the path ahead, in base_link, shape (2,) [m]."""
    base = request.map_from_base
    point_m: FloatArray = base.inverse().apply(ahead(request.path_m, base, LOOKAHEAD_M)[-1:])[0]
    return point_m
