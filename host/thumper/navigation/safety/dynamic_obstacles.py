"""Dynamic obstacles: detect them in the scans, predict their motion, and stop until they have passed.

A hit where a ray passed a moment ago is something that has come there, if an object near it has left its
place. A hit that was hidden before is not. One scan without an echo proves nothing: dark surfaces flicker.
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.costmap.ray_evidence import Evidence, ScanRays
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits

# Age of the scans that the newest one is compared with; more detects slower obstacles.
COMPARED_S, OLDEST_S = 0.3, 0.8
SILENT_SCANS = 4  # so many scans without an echo show that a place was free
SPLIT_M = 0.15  # neighbouring hits further apart belong to different objects
PASSED_M = 0.12  # a ray must have passed this far behind a hit
LEAST_POINTS = 3
LEAST_NEW_FRACTION = 0.5  # of an object's hits must be where rays had passed
WIDEST_M = 1.0  # wider objects are walls
FASTEST_M_S = 2.6  # a foot swings at twice the walking speed, 1.3 m/s
FURTHEST_M = 0.8  # after missed scans too: what is further away is another object
# An earlier object is still there if at least this fraction of it is this near to hits that are not new.
STATIC_M, LEAST_STILL_FRACTION = 0.08, 0.5
LATELY_S = 5.0  # somebody who stands or is hidden for less may move again
STEP_S = 0.1
ROUNDING_S = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class DynamicObstacleOptions:
    """When the robot gives way to dynamic obstacles."""

    # Prediction time in a recovery, at the goal and with priority [s]; 0: the robot gives way to nobody.
    ahead_s: Annotated[float, Ge(0)] = 2.0
    # Distance kept from their predicted positions [m].
    margin_m: Annotated[float, Ge(0)] = 0.12
    # Slower objects count as static [m/s].
    least_m_s: Annotated[float, Gt(0)] = 0.25


class PastScan(NamedTuple):
    """One scan of the comparison."""

    time_s: float
    hits_m: FloatArray  # shape (n, 2), in the local frame, in beam order
    rays: ScanRays
    objects: list[FloatArray]  # the hits, split where neighbours are far apart
    is_small: NDArray[np.bool_]  # which objects are not too wide for a person


class MovingObject(NamedTuple):
    """A dynamic obstacle."""

    points_m: FloatArray  # shape (n, 2), in map
    velocity_m_s: FloatArray  # shape (2,)

    def in_map(self, map_from_local: Pose2) -> "MovingObject":
        """Return this object of the local frame in map."""
        turn = Pose2(theta_rad=map_from_local.theta_rad)
        return MovingObject(map_from_local.apply(self.points_m), turn.apply(self.velocity_m_s))


class SmallObject(NamedTuple):
    """An object of a scan that may be a part of somebody."""

    points_m: FloatArray  # shape (n, 2), in map
    at_rest: bool  # it was there in the oldest scan, too, or hidden

    def in_map(self, map_from_local: Pose2) -> "SmallObject":
        """Return this object of the local frame in map."""
        return self._replace(points_m=map_from_local.apply(self.points_m))


class DynamicObstacles:
    """Compares scans and reports when a command would cross the path of a dynamic obstacle."""

    def __init__(
        self, options: DynamicObstacleOptions, limits: SpeedLimits, footprint: Footprint, view: FieldOfView
    ) -> None:
        self._options = options
        self._view = view
        self._limits = limits
        self._half_planes = footprint.half_planes()
        self._map_from_local = Pose2()
        self._scans: deque[PastScan] = deque()
        self.moving: list[MovingObject] = []  # in the newest scan
        self.small: list[SmallObject] = []  # the same, and what may have stopped
        self._moved_s = -math.inf  # when something moved last

    def move(self, new_from_old: Pose2) -> None:
        """Move the past scans in the map."""
        self._map_from_local = new_from_old @ self._map_from_local

    def update(self, time_s: float, map_from_base: Pose2, hits_in_map_m: FloatArray) -> None:
        """Detect dynamic obstacles in a scan's hits, shape (n, 2) [m], in beam order.

        `map_from_base` is the robot's pose when the scan was taken.
        """
        while self._scans and self._scans[0].time_s < time_s - OLDEST_S - ROUNDING_S:
            self._scans.popleft()
        local_from_map = self._map_from_local.inverse()
        hits_m = local_from_map.apply(hits_in_map_m)
        rays = ScanRays(self._view, local_from_map @ map_from_base, hits_m)
        scan = PastScan(time_s, hits_m, rays, *_objects(hits_m))
        earlier = [past for past in self._scans if past.time_s <= time_s - COMPARED_S + ROUNDING_S]
        moving = self._detect(scan, earlier) if earlier else []
        self.moving = [one.in_map(self._map_from_local) for one in moving]
        self.small = [one.in_map(self._map_from_local) for one in self._small_objects(scan)]
        self._scans.append(scan)
        if self.moving:
            self._moved_s = time_s

    def have_moved_lately(self, time_s: float) -> bool:
        """Return whether something has moved a moment ago."""
        return time_s - self._moved_s < LATELY_S

    def rested(self, points_m: FloatArray) -> NDArray[np.bool_]:
        """Return at which places, shape (n, 2) in map, the oldest scan saw something, or had no view of.

        A place that was hidden counts as free: mostly somebody hid it who walks away from the lidar.
        """
        if not self._scans:
            return np.ones(len(points_m), np.bool_)
        evidence = self._scans[0].rays.evidence(self._map_from_local.inverse().apply(points_m), PASSED_M)
        seen: NDArray[np.bool_] = (evidence == Evidence.SEEN) | (evidence == Evidence.OUT_OF_VIEW)
        return seen

    def stop_reason(
        self, command: Twist2, twist: Twist2, map_from_base: Pose2, moving: list[MovingObject]
    ) -> str | None:
        """Return why the robot must wait for these objects instead of this command, or None."""
        if self._options.ahead_s == 0.0 or not moving:
            return None
        if command == Twist2() or command.v_m_s < 0.0:
            return None
        times_s = np.arange(STEP_S, self._options.ahead_s + 0.5 * STEP_S, STEP_S)
        v = np.where(times_s < self._limits.latency_s, twist.v_m_s, command.v_m_s)
        w = np.where(times_s < self._limits.latency_s, twist.w_rad_s, command.w_rad_s)
        theta = map_from_base.theta_rad + np.cumsum(w) * STEP_S
        cos, sin = np.cos(theta), np.sin(theta)
        at_m = np.array((map_from_base.x_m, map_from_base.y_m))
        at_m = at_m + np.cumsum(np.column_stack((v * cos, v * sin)), axis=0) * STEP_S
        normals = self._half_planes[:, :2]
        normals_in_map = np.stack(  # of the outline at each time
            (
                np.outer(cos, normals[:, 0]) - np.outer(sin, normals[:, 1]),
                np.outer(sin, normals[:, 0]) + np.outer(cos, normals[:, 1]),
            ),
            axis=1,
        )
        least_m = self._half_planes[:, 2] + self._options.margin_m
        for points_m, velocity_m_s in moving:
            offset_m = points_m + (velocity_m_s * times_s[:, None] - at_m)[:, None]
            if (offset_m @ normals_in_map < least_m).all(axis=2).any():
                return "waiting for something that moves"
        return None

    def _detect(self, scan: PastScan, earlier: list[PastScan]) -> list[MovingObject]:
        """Return the objects that have come where rays had passed, and left where they had been."""
        is_new = self._is_new(scan.hits_m, earlier)
        moving: list[MovingObject] = []
        if not is_new.any():
            return moving
        past, new_objects, static_m = earlier[-1], [], [np.empty((0, 2))]
        start = 0
        for points_m, is_small in zip(scan.objects, scan.is_small, strict=True):
            new_fraction = is_new[start : start + len(points_m)].mean()
            start += len(points_m)
            if new_fraction < LEAST_NEW_FRACTION:
                static_m.append(points_m)
            elif is_small:
                new_objects.append(points_m)
        before = [points_m for points_m in past.objects if len(points_m) >= LEAST_POINTS]
        elapsed_s, still_m = scan.time_s - past.time_s, np.vstack(static_m)
        furthest_m = min(FURTHEST_M, FASTEST_M_S * elapsed_s)
        for points_m in new_objects:
            step_m = _step_from(points_m, before, still_m, furthest_m)
            velocity = step_m / elapsed_s
            if math.hypot(*velocity) >= self._options.least_m_s:
                moving.append(MovingObject(points_m, velocity))
        return moving

    def _small_objects(self, scan: PastScan) -> list[SmallObject]:
        """Return the objects that are not too wide for a person."""
        small = [scan.objects[number] for number in np.flatnonzero(scan.is_small)]
        if not small or not self._scans:
            return []
        evidence = self._scans[0].rays.evidence(np.vstack(small), PASSED_M)
        may_rest = (evidence != Evidence.PASSED) & (evidence != Evidence.SILENT)
        rests = np.split(may_rest, np.cumsum([len(points_m) for points_m in small])[:-1])
        return [
            SmallObject(points_m, float(still.mean()) >= LEAST_STILL_FRACTION)
            for points_m, still in zip(small, rests, strict=True)
        ]

    def _is_new(self, hits_m: FloatArray, earlier: list[PastScan]) -> NDArray[np.bool_]:
        """Return which hits are where earlier rays passed, or where several scans had no echo."""
        evidence = np.array([past.rays.evidence(hits_m, PASSED_M) for past in earlier])
        passed = (evidence == Evidence.PASSED).any(axis=0)
        silent = len(earlier) >= SILENT_SCANS and (evidence == Evidence.SILENT).all(axis=0)
        was_seen = (evidence == Evidence.SEEN).any(axis=0)
        is_new: NDArray[np.bool_] = (passed | silent) & ~was_seen & (evidence[-1] != Evidence.HIDDEN)
        return is_new


def _step_from(
    points_m: FloatArray, before: list[FloatArray], static_m: FloatArray, furthest_m: float
) -> FloatArray:
    """Return the way from the nearest object that has left its place, shape (2,); 0 if there is none.

    `before` are the earlier objects; `static_m`, shape (n, 2), are hits of objects that have not moved. An
    object further away than `furthest_m` is another one.
    """
    centre_m = points_m.mean(axis=0)
    steps = sorted(
        ((centre_m - past_m.mean(axis=0), past_m) for past_m in before), key=lambda pair: math.hypot(*pair[0])
    )
    for step_m, past_m in steps:
        if math.hypot(*step_m) > furthest_m:
            break
        distances_m = np.hypot(*(past_m[:, None] - static_m).transpose(2, 0, 1))
        is_still_there = (distances_m.min(axis=1, initial=np.inf) < STATIC_M).mean() >= LEAST_STILL_FRACTION
        if not is_still_there:
            return np.asarray(step_m)
    return np.zeros(2)


def _objects(points_m: FloatArray) -> tuple[list[FloatArray], NDArray[np.bool_]]:
    """Split a scan where neighbouring hits are far apart; return the objects, and which are small."""
    if len(points_m) == 0:
        return [], np.zeros(0, np.bool_)
    gaps = np.hypot(*np.diff(points_m, axis=0).T) > SPLIT_M
    starts = np.concatenate(([0], np.flatnonzero(gaps) + 1))
    extents_m = np.maximum.reduceat(points_m, starts) - np.minimum.reduceat(points_m, starts)
    counts = np.diff(starts, append=len(points_m))
    is_small: NDArray[np.bool_] = (counts >= LEAST_POINTS) & (extents_m.max(axis=1) <= WIDEST_M)
    return np.split(points_m, starts[1:]), is_small
