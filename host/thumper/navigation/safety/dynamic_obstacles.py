"""Dynamic obstacles: detect them in the scans, predict their motion, and stop until they have passed.

A hit where a ray passed a moment ago is something that has come there. A hit that was hidden before is not.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.costmap.obstacle_memory import BIN_RAD
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits

COMPARED_S = 0.3  # time between the two scans that are compared; more detects slower obstacles
SPLIT_M = 0.15  # neighbouring hits further apart belong to different objects
PASSED_M = 0.12  # a ray must have passed this far behind a hit
LEAST_POINTS = 3
LEAST_NEW_FRACTION = 0.5  # of an object's hits must be where rays had passed
WIDEST_M = 1.0  # wider objects are walls
MATCH_M = 0.6
STEP_S = 0.1
ROUNDING_S = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class DynamicObstacleOptions:
    """When the robot waits for dynamic obstacles."""

    # Prediction time of people and other dynamic obstacles [s]; 0 waits for none.
    ahead_s: Annotated[float, Ge(0)] = 2.0
    # Distance kept from their predicted positions [m].
    margin_m: Annotated[float, Ge(0)] = 0.12
    # Slower objects count as static [m/s].
    least_m_s: Annotated[float, Gt(0)] = 0.25


class PastScan(NamedTuple):
    """One scan of the comparison."""

    time_s: float
    map_from_base: Pose2
    hits_m: FloatArray  # shape (n, 2), in map, in beam order


class MovingObject(NamedTuple):
    """A dynamic obstacle."""

    points_m: FloatArray  # shape (n, 2), in map
    velocity_m_s: FloatArray  # shape (2,)


class DynamicObstacles:
    """Compares scans and reports when a command would cross the path of a dynamic obstacle."""

    def __init__(
        self, options: DynamicObstacleOptions, limits: SpeedLimits, footprint: Footprint, view: FieldOfView
    ) -> None:
        self._options = options
        self._view = view
        self._limits = limits
        self._half_planes = footprint.half_planes()
        self._scans: deque[PastScan] = deque()
        self._moving: list[MovingObject] = []

    def update(self, time_s: float, map_from_base: Pose2, hits_in_map_m: FloatArray) -> None:
        """Detect dynamic obstacles in a scan's hits, shape (n, 2) [m], in beam order."""
        scan, latest_s = PastScan(time_s, map_from_base, hits_in_map_m), time_s - COMPARED_S + ROUNDING_S
        while len(self._scans) > 1 and self._scans[1].time_s <= latest_s:
            self._scans.popleft()
        self._moving = []
        if self._scans and self._scans[0].time_s <= latest_s:
            earlier = self._scans[0]
            if time_s - earlier.time_s < 3.0 * COMPARED_S:
                self._moving = self._detect(scan, earlier)
        self._scans.append(scan)

    def stop_reason(self, command: Twist2, twist: Twist2, map_from_base: Pose2) -> str | None:
        """Return why the robot must wait instead of this command, or None."""
        if self._options.ahead_s == 0.0 or not self._moving:
            return None
        if command == Twist2() or command.v_m_s < 0.0:
            return None
        times_s = np.arange(STEP_S, self._options.ahead_s + 0.5 * STEP_S, STEP_S)
        v = np.where(times_s < self._limits.latency_s, twist.v_m_s, command.v_m_s)
        w = np.where(times_s < self._limits.latency_s, twist.w_rad_s, command.w_rad_s)
        theta = map_from_base.theta_rad + np.cumsum(w) * STEP_S
        x = map_from_base.x_m + np.cumsum(v * np.cos(theta)) * STEP_S
        y = map_from_base.y_m + np.cumsum(v * np.sin(theta)) * STEP_S
        for points_m, velocity_m_s in self._moving:
            for k, time_s in enumerate(times_s):
                dx, dy = (points_m + velocity_m_s * time_s - (x[k], y[k])).T
                cos, sin = math.cos(theta[k]), math.sin(theta[k])
                in_base = np.column_stack((cos * dx + sin * dy, -sin * dx + cos * dy))
                inside = (
                    self._half_planes[:, 2] + self._options.margin_m - in_base @ self._half_planes[:, :2].T
                )
                if (inside.min(axis=1) > 0.0).any():
                    speed_m_s = math.hypot(*velocity_m_s)
                    return f"waiting for a dynamic obstacle that moves at {speed_m_s:.1f} m/s"
        return None

    def _detect(self, scan: PastScan, earlier: PastScan) -> list[MovingObject]:
        """Return the objects that have come where rays had passed, with their velocities."""
        is_new = self._is_new(scan.hits_m, earlier)
        moving: list[MovingObject] = []
        if not is_new.any():
            return moving
        centres_before = [
            points_m.mean(axis=0) for points_m in _objects(earlier.hits_m) if len(points_m) >= LEAST_POINTS
        ]
        start = 0
        for points_m in _objects(scan.hits_m):
            new_fraction = is_new[start : start + len(points_m)].mean()
            start += len(points_m)
            if (
                len(points_m) < LEAST_POINTS
                or new_fraction < LEAST_NEW_FRACTION
                or np.ptp(points_m, axis=0).max() > WIDEST_M
                or not centres_before
            ):
                continue
            steps = points_m.mean(axis=0) - np.array(centres_before)
            nearest = steps[np.argmin(np.hypot(*steps.T))]
            velocity = nearest / (scan.time_s - earlier.time_s)
            if math.hypot(*nearest) <= MATCH_M and math.hypot(*velocity) >= self._options.least_m_s:
                moving.append(MovingObject(points_m, velocity))
        return moving

    def _is_new(self, hits_m: FloatArray, earlier: PastScan) -> np.typing.NDArray[np.bool_]:
        """Return which hits are where the earlier scan's rays passed."""
        bins = round(math.tau / BIN_RAD)
        then_rad, then_range_m = self._view.bearings_and_ranges(earlier.map_from_base, earlier.hits_m)
        bearing_rad, range_m = self._view.bearings_and_ranges(earlier.map_from_base, hits_m)
        nearest_m = np.full(bins, np.inf)
        np.minimum.at(nearest_m, (then_rad / BIN_RAD).astype(np.int64) % bins, then_range_m)
        around_m = np.minimum(np.minimum(np.roll(nearest_m, 1), nearest_m), np.roll(nearest_m, -1))
        passed_m = around_m[(bearing_rad / BIN_RAD).astype(np.int64) % bins]
        in_view = self._view.contains(bearing_rad, range_m, edge_rad=2.0 * BIN_RAD)
        is_new: np.typing.NDArray[np.bool_] = in_view & (passed_m > range_m + PASSED_M)
        return is_new


def _objects(points_m: FloatArray) -> list[FloatArray]:
    """Split a scan where neighbouring hits are far apart."""
    if len(points_m) == 0:
        return []
    gaps = np.hypot(*np.diff(points_m, axis=0).T) > SPLIT_M
    return np.split(points_m, np.nonzero(gaps)[0] + 1)
