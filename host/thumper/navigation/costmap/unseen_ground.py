"""Unseen ground: space beside and behind the robot that the lidar has never seen. It counts as an obstacle.

The lidar looks ahead. A robot that backs up, or swings its tail in a rotation, moves over ground that the
current scan does not show. If no earlier scan has shown it either, a chair leg may stand there.

On open ground nothing returns an echo, and the map stays unknown. Ground in which several scans, taken from
different places, found nothing counts as seen. One is not enough: dark legs stay silent from some directions.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.field_of_view import FieldOfView
from thumper.maps.occupancy_grid import FREE, OccupancyGrid
from thumper.navigation.costmap.obstacle_memory import LOOK_STEP_M, SILENT_LOOKS
from thumper.navigation.costmap.ray_evidence import Look
from thumper.navigation.footprint import Footprint, outside_m

REACH_M = 0.25  # beyond the robot's circle: further than it moves before it can stop
# Ground this near to where the robot is at first counts as seen: a robot that may not move at all could
# never see more. Where it moves later it knows only the ground under it, so that no small steps add up.
FIRST_EDGE_M = 0.03
FIRST_AGAIN_M = 0.3  # it has been moved by something else
# The controllers may correct the heading by a little: with less room they would not even set off. The
# collision monitor has the last word.
SLACK_M = 0.055
TURNING_ROOM_M = 0.03  # beyond the robot's circle
EDGE_OF_VIEW_RAD = math.radians(1.0)
STEP_M, STEP_RAD = 0.05, 0.10  # between two remembered poses
REMEMBERED_M, REMEMBERED_POSES = 2.0, 100


class _Visit(NamedTuple):
    """Where the robot was, and what its lidar found there."""

    local_from_base: Pose2
    look: Look | None  # None: the lidar was where it had looked from last


class UnseenGround:
    """Remembers where the robot was, and finds the unknown cells near it that are out of view."""

    def __init__(self, footprint: Footprint, view: FieldOfView) -> None:
        self._half_planes = footprint.half_planes()
        self._turning_m = footprint.circumscribed_radius_m + TURNING_ROOM_M
        self._near_m = footprint.circumscribed_radius_m + REACH_M
        self._view = view
        # The frame of what is remembered; points and poses in it are in "local".
        self._map_from_local = Pose2()
        self._first: Pose2 | None = None
        self._visits: list[_Visit] = []

    def move(self, new_from_old: Pose2) -> None:
        """Move what is remembered in the map."""
        self._map_from_local = new_from_old @ self._map_from_local

    def update(
        self,
        window: OccupancyGrid,
        map_from_base: Pose2,
        hits_m: FloatArray,
        scan_pose: Pose2 | None = None,
    ) -> FloatArray:
        """Return the centres of the unseen cells near the robot, shape (n, 2) [m].

        Marks unknown cells where the robot is or was, and those that it has found open, as free, in place.
        `hits_m`, shape (k, 2), are the echoes of the scan taken at `scan_pose` (None: at `map_from_base`).
        """
        rows, cols = self._unknown_near(window, map_from_base)
        corner_m = np.array((window.origin_x_m, window.origin_y_m))
        centres_m: FloatArray = corner_m + (np.column_stack((cols, rows)) + 0.5) * window.resolution_m
        local_from_map = self._map_from_local.inverse()
        local_from_base = local_from_map @ map_from_base
        self._remember(
            local_from_base, local_from_map @ (scan_pose or map_from_base), local_from_map.apply(hits_m)
        )
        free = self._is_free(local_from_map.apply(centres_m), local_from_base)
        window.cells[rows[free], cols[free]] = FREE
        bearing_rad, range_m = self._view.bearings_and_ranges(map_from_base, centres_m)
        in_view = self._view.contains(bearing_rad, range_m, edge_rad=EDGE_OF_VIEW_RAD)
        return np.asarray(centres_m[~free & ~in_view])

    def _is_free(self, points_m: FloatArray, local_from_base: Pose2) -> NDArray[np.bool_]:
        """Return which points, shape (n, 2), the robot has been on or has found open several times."""
        free = self._outside_m(points_m, self._first or local_from_base) <= FIRST_EDGE_M
        free[~free] = self._was_under(points_m[~free], local_from_base)
        looks = np.zeros(len(points_m), np.int64)
        for visit in reversed(self._visits):
            left = np.flatnonzero(~free)
            if not left.size:
                break
            if visit.look is not None:
                looks[left] += visit.look.is_open(points_m[left])
                free[left] = looks[left] >= SILENT_LOOKS
        return free

    def _was_under(self, points_m: FloatArray, local_from_base: Pose2) -> NDArray[np.bool_]:
        """Return which points near the robot, shape (n, 2), it is on or has been on."""
        poses = [visit.local_from_base for visit in self._visits]
        near = [pose for pose in poses if pose.distance_m(local_from_base) <= self._near_m + self._turning_m]
        x_m, y_m, theta_rad = np.array([(p.x_m, p.y_m, p.theta_rad) for p in (local_from_base, *near)]).T
        dx_m, dy_m = points_m[:, :1] - x_m, points_m[:, 1:] - y_m
        cos, sin = np.cos(theta_rad), np.sin(theta_rad)
        ahead_m, left_m = cos * dx_m + sin * dy_m, cos * dy_m - sin * dx_m
        inside = np.ones(ahead_m.shape, np.bool_)
        for a, b, edge_m in self._half_planes:
            inside &= a * ahead_m + b * left_m <= edge_m
        return np.asarray(inside.any(axis=1))

    def beyond_slack(self, points_m: FloatArray, map_from_base: Pose2) -> FloatArray:
        """Return the points that are further from the robot than `SLACK_M`."""
        return np.asarray(points_m[self._outside_m(points_m, map_from_base) > SLACK_M])

    def move_ahead_m(self, points_m: FloatArray, map_from_base: Pose2) -> float:
        """Return how far the robot must drive straight ahead until it may turn: 0 if it may turn here [m]."""
        x_m, y_m = map_from_base.inverse().apply(points_m).T
        within = np.hypot(x_m, y_m) < self._turning_m
        half_chords_m = np.sqrt(self._turning_m**2 - y_m[within] ** 2)
        return float((x_m[within] + half_chords_m).max(initial=0.0))

    def _outside_m(self, points_m: FloatArray, map_from_base: Pose2) -> FloatArray:
        """Return how far points, shape (n, 2), are outside the footprint's edges at a pose, shape (n,)."""
        return outside_m(map_from_base.inverse().apply(points_m), self._half_planes)

    def _unknown_near(
        self, window: OccupancyGrid, map_from_base: Pose2
    ) -> tuple[np.typing.NDArray[np.int64], np.typing.NDArray[np.int64]]:
        """Return rows and columns of the unknown cells within reach, shape (n,) each."""
        row, col = window.cell_of(map_from_base.x_m, map_from_base.y_m)
        half = math.ceil(self._near_m / window.resolution_m)
        top, left = max(0, row - half), max(0, col - half)
        unknown = window.cells[top : max(0, row + half + 1), left : max(0, col + half + 1)] < 0
        rows, cols = np.nonzero(unknown)
        near = np.hypot(rows + top - row, cols + left - col) <= half
        return rows[near] + top, cols[near] + left

    def _remember(self, local_from_base: Pose2, scan_pose: Pose2, hits_m: FloatArray) -> None:
        """Add a visit whose pose differs from that of the newest; forget those far away."""
        last = self._visits[-1].local_from_base if self._visits else None
        if last is None or last.distance_m(local_from_base) > FIRST_AGAIN_M:
            self._first = local_from_base
        else:
            moved = last.inverse() @ local_from_base
            if math.hypot(moved.x_m, moved.y_m) < STEP_M and abs(moved.theta_rad) < STEP_RAD:
                return
        near = [
            visit
            for visit in self._visits
            if visit.local_from_base.distance_m(local_from_base) <= REMEMBERED_M
        ]
        look = Look(self._view, scan_pose, hits_m)
        looked_from = next((visit.look for visit in reversed(near) if visit.look is not None), None)
        is_new = looked_from is None or look.distance_m(looked_from) >= LOOK_STEP_M
        self._visits = [*near[-REMEMBERED_POSES + 1 :], _Visit(local_from_base, look if is_new else None)]
