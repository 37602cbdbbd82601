"""Who caused a contact with a walking person: the robot that drove on, or the person who walked in.

It is the robot's if its outline moves towards the leg at the touch, and came further towards it than the leg
came towards the outline. That counts over the time in which no robot can respond: a foot swings at twice the
walking speed and then rests, so its speed at the touch says nothing about who came. The touch of a leg that
was in the outline at the start of that time is the person's. A robot that then drives on against the resting
leg has a contact all the same.
"""

import math
from collections import deque
from typing import TypeVar

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.bench.collision import CLEAR_M
from thumper_hil.world.segment_raycast import polygon_clearance_m

STATIONARY_M_S = 0.06
"""Below this speed the robot's outline does not approach anybody."""

FURTHEST_STEP_M = 0.1
"""No leg moves further between two checks."""

PUSHED_M = 0.05
"""A contact of the robot if its outline comes this much further over a leg that has rested for `RESPONSE_S`.

A robot that brakes at once from 0.4 m/s comes 3 cm further: it stops within 11 cm, 8 of them in that time.
"""

RESTING_M = 0.01  # within `RESPONSE_S`

RESPONSE_S = 0.2
"""From a command until the base responds: the product's `SpeedLimits.latency_s`, without a scan's age."""

ROUNDING_S = 1e-6
NO_SEGMENTS = np.zeros((0, 4))

T = TypeVar("T")


class LegContacts:
    """Counts touches of the robot's outline with legs. Legs never hold the robot."""

    def __init__(self, footprint_m: FloatArray) -> None:
        self.by_robot = 0
        self.by_people = 0
        self._footprint_m = footprint_m
        # How far each touching leg, by its index, was in the outline when it walked in: inf after a contact.
        self._touching: dict[int, float] = {}
        self._time_s = 0.0
        self._poses: deque[tuple[float, Pose2]] = deque()
        self._paths: list[deque[tuple[float, FloatArray]]] = []  # of the legs

    def check(self, pose: Pose2, legs_m: FloatArray, elapsed_s: float) -> None:
        """Count the legs, shape (n, 3), that touch the outline at `pose` and did not before."""
        self._time_s += elapsed_s
        before = self._poses[-1][1] if self._poses else pose
        self._append(self._poses, pose)
        befores = [self._before_of(leg) for leg in legs_m]
        # Two legs may have the same one before them.
        self._paths = [deque() if k is None else self._paths[k].copy() for k in befores]
        for path, leg in zip(self._paths, legs_m, strict=True):
            self._append(path, leg)
        outline_m = pose.apply(self._footprint_m)
        touching: dict[int, float] = {}
        for index, leg in enumerate(legs_m):
            if np.hypot(leg[0] - pose.x_m, leg[1] - pose.y_m) > 1.0:
                continue
            in_m = None if (index_before := befores[index]) is None else self._touching.get(index_before)
            if _clearance_m(outline_m, leg) > (0.0 if in_m is None else CLEAR_M):
                continue
            depth_m = _depth_m(outline_m, leg)
            if in_m is None:
                in_m = depth_m
                is_robots = self._is_robots(pose, before, leg, self._paths[index][0], elapsed_s)
                self.by_people += not is_robots
            else:
                rests = self._rests(index)
                is_robots = rests and depth_m > in_m + PUSHED_M
                in_m = in_m if rests or in_m == math.inf else depth_m
            self.by_robot += is_robots
            touching[index] = math.inf if is_robots else in_m
        self._touching = touching

    def _rests(self, index: int) -> bool:
        path = self._paths[index]
        is_known = path[-1][0] - path[0][0] >= RESPONSE_S - ROUNDING_S
        return is_known and float(np.hypot(*(path[-1][1] - path[0][1])[:2])) <= RESTING_M

    def _append(self, history: deque[tuple[float, T]], newest: T) -> None:
        """Add the newest entry; drop those older than `RESPONSE_S`."""
        history.append((self._time_s, newest))
        while history[0][0] < self._time_s - RESPONSE_S - ROUNDING_S:
            history.popleft()

    def _before_of(self, leg: FloatArray) -> int | None:
        """Return the index that a leg, shape (3,), had one step before: a person who turns swaps the two."""
        away_m = [float(np.hypot(*(path[-1][1][:2] - leg[:2]))) for path in self._paths]
        nearest = int(np.argmin(away_m)) if away_m else 0
        return nearest if away_m and away_m[nearest] < FURTHEST_STEP_M else None

    def _is_robots(
        self, pose: Pose2, before: Pose2, leg: FloatArray, oldest: tuple[float, FloatArray], elapsed_s: float
    ) -> bool:
        """Return whether the robot caused a touch that begins."""
        then_s, leg_then = oldest
        pose_then = dict(self._poses)[then_s]  # a leg may be known for less than `RESPONSE_S`
        # The point of the body at the leg, carried back to where it was one step before.
        leg_m, outline_m = leg[:2], pose.apply(self._footprint_m)
        moved_m = leg_m - before.apply(pose.inverse().apply(leg_m[None, :]))[0]
        away_m = leg_m - _nearest_m(outline_m, leg_m)
        robot_m_s = float(moved_m @ away_m) / max(float(np.hypot(*away_m)), 1e-9) / elapsed_s
        robot_came_m = _clearance_m(pose_then.apply(self._footprint_m), leg)
        person_came_m = _clearance_m(outline_m, leg_then)
        # A leg that walked in on one side may step out on another, ahead of the robot.
        walked_through = _clearance_m(pose_then.apply(self._footprint_m), leg_then) <= 0.0
        return robot_m_s > STATIONARY_M_S and robot_came_m > person_came_m and not walked_through


def _clearance_m(outline_m: FloatArray, leg: FloatArray) -> float:
    return polygon_clearance_m(outline_m, NO_SEGMENTS, leg[None, :])


def _depth_m(outline_m: FloatArray, leg: FloatArray) -> float:
    """Return how far a leg, shape (3,), is in a convex outline, shape (k, 2), counter-clockwise."""
    edges_m = np.roll(outline_m, -1, axis=0) - outline_m
    away_m = leg[:2] - outline_m
    inside_m = (edges_m[:, 0] * away_m[:, 1] - edges_m[:, 1] * away_m[:, 0]) / np.hypot(*edges_m.T)
    return float(inside_m.min() + leg[2])


def _nearest_m(outline_m: FloatArray, point_m: FloatArray) -> FloatArray:
    """Return the point of a closed outline, shape (k, 2), that is nearest to a point, shape (2,)."""
    edges_m = np.roll(outline_m, -1, axis=0) - outline_m
    along = np.einsum("ij,ij->i", point_m - outline_m, edges_m) / np.einsum("ij,ij->i", edges_m, edges_m)
    nearest_m = outline_m + np.clip(along, 0.0, 1.0)[:, None] * edges_m
    return np.asarray(nearest_m[np.argmin(np.hypot(*(nearest_m - point_m).T))])
