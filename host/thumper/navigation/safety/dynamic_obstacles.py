"""Gives way to what moves: finds it in the scans, thinks it ahead, and stands still until it has passed.

A hit where a moment ago a ray passed is something that came there; what was merely hidden before is not.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.costmap.obstacle_memory import BIN_RAD
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits

GAP_M = 0.15  # between two hits of one thing
BEHIND_M = 0.12  # a ray must have passed this far behind
LEAST_POINTS = 3
WIDEST_M = 1.0  # wider things are walls
MATCH_M = 0.6
STEP_S = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class DynamicObstacleOptions:
    """When the robot gives way."""

    # How far what moves and the robot are thought ahead [s]; 0 gives way to nobody.
    ahead_s: Annotated[float, Ge(0)] = 2.0
    # Distance kept from where it will be [m].
    margin_m: Annotated[float, Ge(0)] = 0.12
    # Time between the two scans that are compared [s]; more notices slower things.
    between_s: Annotated[float, Gt(0)] = 0.3
    # Slower things count as standing [m/s].
    least_m_s: Annotated[float, Gt(0)] = 0.25


class DynamicObstacles:
    """Remembers the last scans and says when a command would cross the way of something that moves."""

    def __init__(
        self, options: DynamicObstacleOptions, limits: SpeedLimits, footprint: Footprint, view: FieldOfView
    ) -> None:
        self._options = options
        self._view = view
        self._limits = limits
        self._half_planes = footprint.half_planes()
        self._scans: deque[tuple[float, Pose2, FloatArray]] = deque()
        self._moving: list[tuple[FloatArray, FloatArray]] = []

    def update(self, time_s: float, map_from_base: Pose2, hits_in_map_m: FloatArray) -> None:
        """Take a scan's hits, shape (n, 2) [m], in the order of their beams."""
        self._moving = []
        while len(self._scans) > 1 and self._scans[1][0] <= time_s - self._options.between_s + 1e-6:
            self._scans.popleft()
        if self._scans and self._scans[0][0] <= time_s - self._options.between_s + 1e-6:
            then_s, then_from, then_m = self._scans[0]
            if time_s - then_s < 3.0 * self._options.between_s:
                self._moving = self._find(hits_in_map_m, then_from, then_m, time_s - then_s)
        self._scans.append((time_s, map_from_base, hits_in_map_m))

    def objection(self, command: Twist2, twist: Twist2, map_from_base: Pose2) -> str:
        """Return why the robot should stand, or an empty string."""
        if self._options.ahead_s == 0.0 or not self._moving:
            return ""
        if command == Twist2() or command.v_m_s < 0.0:
            return ""
        times_s = np.arange(STEP_S, self._options.ahead_s + 0.5 * STEP_S, STEP_S)
        v = np.where(times_s < self._limits.latency_s, twist.v_m_s, command.v_m_s)
        w = np.where(times_s < self._limits.latency_s, twist.w_rad_s, command.w_rad_s)
        theta = map_from_base.theta_rad + np.cumsum(w) * STEP_S
        x = map_from_base.x_m + np.cumsum(v * np.cos(theta)) * STEP_S
        y = map_from_base.y_m + np.cumsum(v * np.sin(theta)) * STEP_S
        for points_m, speed_m_s in self._moving:
            for k, time_s in enumerate(times_s):
                dx, dy = (points_m + speed_m_s * time_s - (x[k], y[k])).T
                cos, sin = math.cos(theta[k]), math.sin(theta[k])
                in_base = np.column_stack((cos * dx + sin * dy, -sin * dx + cos * dy))
                inside = (
                    self._half_planes[:, 2] + self._options.margin_m - in_base @ self._half_planes[:, :2].T
                )
                if (inside.min(axis=1) > 0.0).any():
                    fast = math.hypot(*speed_m_s)
                    return f"giving way to something that moves at {fast:.1f} m/s"
        return ""

    def _find(
        self, hits_m: FloatArray, then_from: Pose2, then_m: FloatArray, gone_s: float
    ) -> list[tuple[FloatArray, FloatArray]]:
        """Points and velocity [m/s] of each thing that came where rays had passed."""
        came = self._came(hits_m, then_from, then_m)
        found: list[tuple[FloatArray, FloatArray]] = []
        if not came.any():
            return found
        before = [things.mean(axis=0) for things in _things(then_m) if len(things) >= LEAST_POINTS]
        start = 0
        for thing in _things(hits_m):
            share = came[start : start + len(thing)].mean()
            start += len(thing)
            if (
                len(thing) < LEAST_POINTS
                or share < 0.5
                or np.ptp(thing, axis=0).max() > WIDEST_M
                or not before
            ):
                continue
            middle = thing.mean(axis=0)
            steps = middle - np.array(before)
            nearest = steps[np.argmin(np.hypot(*steps.T))]
            speed = nearest / gone_s
            if math.hypot(*nearest) <= MATCH_M and math.hypot(*speed) >= self._options.least_m_s:
                found.append((thing, speed))
        return found

    def _came(self, hits_m: FloatArray, then_from: Pose2, then_m: FloatArray) -> np.typing.NDArray[np.bool_]:
        """Which hits lie where the earlier scan's rays passed."""
        bins = round(math.tau / BIN_RAD)
        then_rad, then_range_m = self._view.bearings_and_ranges(then_from, then_m)
        bearing_rad, range_m = self._view.bearings_and_ranges(then_from, hits_m)
        seen_m = np.full(bins, np.inf)
        np.minimum.at(seen_m, (then_rad / BIN_RAD).astype(np.int64) % bins, then_range_m)
        around_m = np.minimum(np.minimum(np.roll(seen_m, 1), seen_m), np.roll(seen_m, -1))
        passed_m = around_m[(bearing_rad / BIN_RAD).astype(np.int64) % bins]
        in_view = self._view.contains(bearing_rad, range_m, edge_rad=2.0 * BIN_RAD)
        came: np.typing.NDArray[np.bool_] = in_view & (passed_m > range_m + BEHIND_M)
        return came


def _things(points_m: FloatArray) -> list[FloatArray]:
    """Cut a scan where neighbours are far apart."""
    if len(points_m) == 0:
        return []
    gaps = np.hypot(*np.diff(points_m, axis=0).T) > GAP_M
    return np.split(points_m, np.nonzero(gaps)[0] + 1)
