"""The robot's recent poses, so that each ray of a scan is drawn from where it was measured."""

from collections import deque

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.odometry.pose_buffer import interpolate_poses

MAX_POSES = 30  # three seconds at 10 Hz; a scan is 0.1 s old


class PoseHistory:
    """The newest poses `map_from_base` with their times."""

    def __init__(self) -> None:
        self._poses: deque[tuple[float, Pose2]] = deque(maxlen=MAX_POSES)

    def add(self, time_s: float, map_from_base: Pose2) -> None:
        """Add a pose; if it is older than the newest, start again: the clock was set back."""
        if self._poses and time_s <= self._poses[-1][0]:
            self._poses.clear()
        self._poses.append((time_s, map_from_base))

    def in_map(self, points_in_base_m: FloatArray, times_s: FloatArray) -> FloatArray:
        """Transform points, shape (n, 2), measured at `times_s`, shape (n,), to the map.

        Empty without poses. Before the first and after the last pose the robot counts as stationary.
        """
        if not self._poses:
            return np.empty((0, 2))
        pose_times_s = np.array([time_s for time_s, _ in self._poses])
        poses = np.array([(pose.x_m, pose.y_m, pose.theta_rad) for _, pose in self._poses])
        x_m, y_m, theta_rad = interpolate_poses(times_s, pose_times_s, poses).T
        cos, sin = np.cos(theta_rad), np.sin(theta_rad)
        return np.column_stack(
            (
                x_m + cos * points_in_base_m[:, 0] - sin * points_in_base_m[:, 1],
                y_m + sin * points_in_base_m[:, 0] + cos * points_in_base_m[:, 1],
            )
        )
