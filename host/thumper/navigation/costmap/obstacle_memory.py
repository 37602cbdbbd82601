"""Obstacle memory: scan points near the robot, kept out of view, cleared by the lidar's rays.

A map of 5 cm cells loses a thin post that fills part of a cell, and the lidar does not see behind itself.
Both matter when a corner of the robot swings past something that it saw a moment ago. One scan without an
echo clears nothing: a dark leg stays silent at times.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.costmap.ray_evidence import BIN_RAD, Evidence, ScanRays
from thumper.navigation.footprint import Footprint, outside_m

CLEARING_M = 0.08  # a ray that passes this far behind a point clears it
# Looks without an echo from a point clear it, too, if the lidar has moved between them: an open hall returns
# nothing from anywhere, a dark surface nothing from some directions. For points that are not beside the
# robot, looks some time apart are enough: people walk through the hall.
SILENT_LOOKS, LOOK_STEP_M, LOOK_STEP_S = 3, 0.06, 0.4
NOWHERE_M = 1e6
VOXEL_M = 0.02
# While a point is out of view, the pose drifts against it by about this fraction of the distance driven, but
# hardly by more than the limit, because the map holds the pose. More room, for the lidar's own error, closes
# gaps and prevents no contact (docs/results/navigation-history.md).
ERROR_FRACTION, MAX_ERROR_M = 0.025, 0.02
MIN_STEP_M = 0.05  # a shorter movement is the pose noise of a stationary robot
BELOW_M = 0.04  # inside the outline; the pose may be wrong by less
BESIDE_M = 0.25  # beyond the robot's circle; about as far as it backs up, where only this memory sees


@dataclass(frozen=True, slots=True, kw_only=True)
class ObstacleMemoryOptions:
    """How long and how far scan points are remembered."""

    # Points within this distance of the robot are remembered [m]; 0 turns the memory off.
    radius_m: Annotated[float, Ge(0)] = 0.8
    # The same for the global planner alone: so it does not return to a path just seen blocked [m].
    planning_radius_m: Annotated[float, Ge(0)] = 3.0
    # A point that no ray has confirmed or cleared is forgotten after this time, unless it is beside the robot
    # [s].
    keep_s: Annotated[float, Gt(0)] = 20.0


class ObstacleMemory:
    """Adds to each scan the points near the robot that this scan could not see.

    Points are kept within `radius_m`. Points in the circle of `padded` or right beside it are kept until a
    ray clears them, or until the robot is where they were: somebody has walked away, or lifted the robot.
    """

    def __init__(
        self,
        options: ObstacleMemoryOptions,
        radius_m: float,
        view: FieldOfView,
        *,
        footprint: Footprint,
        padded: Footprint,
    ) -> None:
        """`footprint` is the robot's own, `padded` the one of planning."""
        self._keep_s = options.keep_s
        self._radius_m = radius_m
        self._half_planes = footprint.half_planes()
        self._footprint_radius_m = padded.circumscribed_radius_m
        self._beside_m = self._footprint_radius_m + BESIDE_M
        self._view = view
        self._points_m: FloatArray = np.empty((0, 2))
        self._times_s: FloatArray = np.empty(0)  # when each was last seen
        self._seen_at_m: FloatArray = np.empty(0)  # distance driven when each was last seen
        self._silent: NDArray[np.int64] = np.empty(0, np.int64)  # looks without an echo since then
        # Where the lidar was at the last of them, and when.
        self._looked_from_m: FloatArray = np.empty((0, 2))
        self._looked_s: FloatArray = np.empty(0)
        self._driven_m, self._anchor = 0.0, Pose2()
        self.position_error_m: FloatArray = np.empty(0)

    def forget_beyond(self, map_from_base: Pose2, radius_m: float) -> None:
        """Forget points further away than `radius_m`.

        Points beside the robot that the lidar does not see stay: the robot might back into them before it
        sees them again.
        """
        bearing_rad, range_m = self._view.bearings_and_ranges(map_from_base, self._points_m)
        kept = ~self._view.contains(bearing_rad, range_m, edge_rad=BIN_RAD)
        kept &= _within(self._points_m, map_from_base, self._beside_m)
        kept |= _within(self._points_m, map_from_base, radius_m)
        self._keep(kept)

    def move(self, new_from_old: Pose2) -> None:
        """Move the points with the map."""
        self._points_m = new_from_old.apply(self._points_m)
        self._looked_from_m = new_from_old.apply(self._looked_from_m)
        self._anchor = new_from_old @ self._anchor

    def update(
        self,
        time_s: float,
        map_from_base: Pose2,
        hits_in_map_m: FloatArray,
        scan_pose: Pose2 | None = None,
        *,
        new_m: FloatArray | None = None,
    ) -> FloatArray:
        """Add a scan's hits, shape (n, 2) [m]; return the remembered points in `map`, shape (m, 2) [m].

        `scan_pose` is the robot's pose at the time of the scan; None: `map_from_base`. Of the
        hits only `new_m`, shape (k, 2), are remembered; None: all. Sets `position_error_m`, shape (m,): how
        far each point may be off by now.
        """
        self._keep(~self._forget(time_s, map_from_base, hits_in_map_m, scan_pose or map_from_base))
        remembered_m = self._points_m
        self.position_error_m = np.minimum(MAX_ERROR_M, ERROR_FRACTION * (self._driven_m - self._seen_at_m))
        new_m = hits_in_map_m if new_m is None else new_m
        near = new_m[_within(new_m, map_from_base, self._radius_m)]
        all_m = np.vstack((near, remembered_m))
        all_s = np.concatenate((np.full(len(near), time_s), self._times_s))
        all_seen_at_m = np.concatenate((np.full(len(near), self._driven_m), self._seen_at_m))
        voxels = np.floor(all_m / VOXEL_M).astype(np.int64)
        # One number per voxel: `np.unique` sorts numbers much faster than rows.
        _, first = np.unique(voxels[:, 0] * 2**32 + voxels[:, 1], return_index=True)
        self._points_m, self._times_s, self._seen_at_m = all_m[first], all_s[first], all_seen_at_m[first]
        self._silent = np.concatenate((np.zeros(len(near), np.int64), self._silent))[first]
        self._looked_from_m = np.vstack((np.full((len(near), 2), NOWHERE_M), self._looked_from_m))[first]
        self._looked_s = np.concatenate((np.full(len(near), time_s), self._looked_s))[first]
        return remembered_m

    def recheck(
        self, time_s: float, map_from_base: Pose2, hits_in_map_m: FloatArray, scan_pose: Pose2
    ) -> FloatArray:
        """Forget what `update` would, but remember nothing new; return the points, shape (m, 2) [m]."""
        seen = self._forget(time_s, map_from_base, hits_in_map_m, scan_pose)
        self._times_s[seen], self._seen_at_m[seen], self._silent[seen] = time_s, self._driven_m, 0
        return self._points_m

    def _forget(
        self, time_s: float, map_from_base: Pose2, hits_m: FloatArray, scan_pose: Pose2
    ) -> NDArray[np.bool_]:
        """Forget points that are old, gone or far away; return which of the others the scan shows."""
        self._count_distance(map_from_base)
        fresh = self._times_s > time_s - self._keep_s
        fresh |= _within(self._points_m, map_from_base, self._beside_m)
        self._keep(fresh)
        evidence = self._judge(time_s, scan_pose, hits_m)
        gone = (evidence == Evidence.PASSED) | (self._silent >= SILENT_LOOKS) | self._are_below(scan_pose)
        kept = ~gone & _within(self._points_m, map_from_base, self._radius_m)
        self._keep(kept)
        return np.asarray(evidence[kept] == Evidence.SEEN)

    def _keep(self, kept: NDArray[np.bool_]) -> None:
        if kept.all():
            return
        self._points_m, self._times_s = self._points_m[kept], self._times_s[kept]
        self._seen_at_m = self._seen_at_m[kept]
        self._silent, self._looked_from_m = self._silent[kept], self._looked_from_m[kept]
        self._looked_s = self._looked_s[kept]

    def _judge(self, time_s: float, scan_pose: Pose2, hits_m: FloatArray) -> NDArray[np.int64]:
        """Return the scan's `Evidence` about each point, and count the looks without an echo."""
        evidence = ScanRays(self._view, scan_pose, hits_m).evidence(self._points_m, CLEARING_M)
        lidar = scan_pose @ self._view.base_from_laser
        looked_m = np.hypot(*(self._looked_from_m - (lidar.x_m, lidar.y_m)).T)
        later = time_s - self._looked_s >= LOOK_STEP_S
        later &= ~_within(self._points_m, scan_pose, self._beside_m)
        new_look = (evidence == Evidence.SILENT) & ((looked_m >= LOOK_STEP_M) | later)
        self._silent[new_look] += 1
        self._looked_from_m[new_look], self._looked_s[new_look] = (lidar.x_m, lidar.y_m), time_s
        return evidence

    def _are_below(self, map_from_base: Pose2) -> NDArray[np.bool_]:
        """Return which points are below the robot."""
        in_base_m = map_from_base.inverse().apply(self._points_m)
        below: NDArray[np.bool_] = outside_m(in_base_m, self._half_planes) < -BELOW_M
        return below

    def _count_distance(self, map_from_base: Pose2) -> None:
        """Sum up the movement of the outermost point, without the pose noise of a stationary robot."""
        moved = self._anchor.inverse() @ map_from_base
        step_m = math.hypot(moved.x_m, moved.y_m) + self._footprint_radius_m * abs(moved.theta_rad)
        if step_m > MIN_STEP_M:
            self._driven_m += step_m
            self._anchor = map_from_base


def _within(points_m: FloatArray, map_from_base: Pose2, radius_m: float) -> NDArray[np.bool_]:
    """Return which points, shape (n, 2), are within a distance of the robot."""
    dx_m, dy_m = points_m[:, 0] - map_from_base.x_m, points_m[:, 1] - map_from_base.y_m
    within: NDArray[np.bool_] = np.hypot(dx_m, dy_m) <= radius_m
    return within
