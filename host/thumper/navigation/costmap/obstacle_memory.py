"""The obstacle layer near the robot: raw scan points kept where the lidar no longer looks, cleared by its
rays.

A map of 5 cm cells forgets a thin post that fills a part of a cell, and the lidar does not see behind itself:
both matter when a corner of the robot swings past something that it saw a moment ago.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.field_of_view import FieldOfView

BIN_RAD = math.radians(1.0)
THICKNESS_M = 0.08  # a ray must pass this far behind a point before the point counts as gone
VOXEL_M = 0.02
# The pose drifts against what is out of view: by about this part of the way since then, and, as the map holds
# it, hardly by more than the second.
SPREAD_PART, MOST_SPREAD_M = 0.025, 0.02
STEP_M = 0.05  # a pose nearer than this to the one counted last is a standing robot's noise
BESIDE_M = 0.25  # beyond the robot's own circle; about as far as it backs up, where only this memory sees


@dataclass(frozen=True, slots=True, kw_only=True)
class ObstacleMemoryOptions:
    """What is remembered of the scans."""

    # Points within this distance of the robot are remembered [m]; 0 remembers nothing.
    radius_m: Annotated[float, Ge(0)] = 0.8
    # The same for the global planner alone: it does not take up again a way that it has just seen shut [m].
    planning_radius_m: Annotated[float, Ge(0)] = 3.0
    # A point that no ray has confirmed or cleared is forgotten after this time, unless it is beside the robot
    # [s].
    keep_s: Annotated[float, Gt(0)] = 20.0


class ObstacleMemory:
    """Adds to each scan the points near the robot that it could not see again.

    They are kept within `radius_m`. `hull_m` is the radius of the robot's own circle: what lies in it or
    right beside it is kept until a ray clears it.
    """

    def __init__(
        self, options: ObstacleMemoryOptions, radius_m: float, view: FieldOfView, hull_m: float
    ) -> None:
        self._keep_s = options.keep_s
        self._radius_m = radius_m
        self._hull_m = hull_m
        self._beside_m = hull_m + BESIDE_M
        self._view = view
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._points_m, self._times_s, self._seen_m = np.empty((0, 2)), np.empty(0), np.empty(0)
        self.spread_m: FloatArray = np.empty(0)
        self._travel_m, self._anchor = 0.0, Pose2()

    def forget_beyond(self, map_from_base: Pose2, radius_m: float) -> None:
        """Forget what is further away; what is nearer may touch the robot and is never forgotten on purpose.

        Nor is what lies beside the robot where the lidar does not look: it would not be seen again before the
        robot backs into it.
        """
        bearing_rad, range_m = self._view.bearings_and_ranges(map_from_base, self._points_m)
        kept = ~self._view.contains(bearing_rad, range_m, edge_rad=BIN_RAD)
        kept &= _within(self._points_m, map_from_base, self._beside_m)
        kept |= _within(self._points_m, map_from_base, radius_m)
        self._keep(kept)

    def update(self, time_s: float, map_from_base: Pose2, hits_in_map_m: FloatArray) -> FloatArray:
        """Take a scan's hits, shape (n, 2) [m]; return the remembered points in `map`, shape (m, 2) [m].

        `spread_m`, shape (m,), then tells how far off each of them may be by now.
        """
        self._count_travel(map_from_base)
        fresh = self._times_s > time_s - self._keep_s
        fresh |= _within(self._points_m, map_from_base, self._beside_m)
        self._keep(fresh)
        self._keep(self._is_hidden(self._points_m, map_from_base, hits_in_map_m))
        self._keep(_within(self._points_m, map_from_base, self._radius_m))
        remembered_m = self._points_m
        self.spread_m = np.minimum(MOST_SPREAD_M, SPREAD_PART * (self._travel_m - self._seen_m))
        near = hits_in_map_m[_within(hits_in_map_m, map_from_base, self._radius_m)]
        all_m = np.vstack((near, remembered_m))
        all_s = np.concatenate((np.full(len(near), time_s), self._times_s))
        all_seen_m = np.concatenate((np.full(len(near), self._travel_m), self._seen_m))
        _, first = np.unique(np.floor(all_m / VOXEL_M).astype(np.int64), axis=0, return_index=True)
        self._points_m, self._times_s, self._seen_m = all_m[first], all_s[first], all_seen_m[first]
        return remembered_m

    def _keep(self, kept: np.typing.NDArray[np.bool_]) -> None:
        self._points_m, self._times_s = self._points_m[kept], self._times_s[kept]
        self._seen_m = self._seen_m[kept]

    def _count_travel(self, map_from_base: Pose2) -> None:
        """Add up the way of the outermost point; what a standing robot's pose does is no way."""
        moved = self._anchor.inverse() @ map_from_base
        way_m = math.hypot(moved.x_m, moved.y_m) + self._hull_m * abs(moved.theta_rad)
        if way_m > STEP_M:
            self._travel_m += way_m
            self._anchor = map_from_base

    def _is_hidden(
        self, points_m: FloatArray, map_from_base: Pose2, hits_m: FloatArray
    ) -> np.typing.NDArray[np.bool_]:
        """Whether the scan says nothing of a point: out of view, or behind something nearer."""
        bearing_rad, range_m = self._view.bearings_and_ranges(map_from_base, points_m)
        hit_rad, hit_m = self._view.bearings_and_ranges(map_from_base, hits_m)
        seen_m = np.full(round(math.tau / BIN_RAD) + 2, np.inf)
        np.minimum.at(seen_m, 1 + ((hit_rad + math.pi) / BIN_RAD).astype(np.int64) % (seen_m.size - 2), hit_m)
        seen_m[0], seen_m[-1] = seen_m[-2], seen_m[1]
        around_m = np.minimum(np.minimum(seen_m[:-2], seen_m[1:-1]), seen_m[2:])
        there_m = around_m[((bearing_rad + math.pi) / BIN_RAD).astype(np.int64) % around_m.size]
        in_view = self._view.contains(bearing_rad, range_m, edge_rad=BIN_RAD)
        hidden: np.typing.NDArray[np.bool_] = ~in_view | (there_m < range_m - THICKNESS_M)
        return hidden


def _within(points_m: FloatArray, map_from_base: Pose2, radius_m: float) -> np.typing.NDArray[np.bool_]:
    """Whether points, shape (n, 2), lie within a distance of the robot."""
    dx_m, dy_m = points_m[:, 0] - map_from_base.x_m, points_m[:, 1] - map_from_base.y_m
    within: np.typing.NDArray[np.bool_] = np.hypot(dx_m, dy_m) <= radius_m
    return within
