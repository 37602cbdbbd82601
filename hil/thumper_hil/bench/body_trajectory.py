"""The recent poses and pitch angles of the body, for beams that are cast a little later."""

from collections import deque

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.odometry.pose_buffer import interpolate_poses

MAX_POSES = 256  # a sweep of the lidar takes 75 ms, and a busy reader polls every millisecond


class BodyTrajectory:
    """Poses with their times; interpolates between them."""

    def __init__(self) -> None:
        self._rows: deque[tuple[float, float, float, float, float]] = deque(maxlen=MAX_POSES)
        self._pitch_rad = 0.0

    @property
    def newest_s(self) -> float:
        """Time of the newest pose [s]."""
        return self._rows[-1][0] if self._rows else -1.0

    def add(self, time_s: float, pose: Pose2, pitch_rad: float | None = None) -> None:
        """Add a pose; without a pitch the last one still holds."""
        if pitch_rad is not None:
            self._pitch_rad = pitch_rad
        self._rows.append((time_s, pose.x_m, pose.y_m, pose.theta_rad, self._pitch_rad))

    def pose_at(self, times_s: FloatArray) -> FloatArray:
        """Return map_from_base, shape (n, 3), at times within the last tenth of a second."""
        known = np.array(self._rows)
        return interpolate_poses(times_s, known[:, 0], known[:, 1:4])

    def pitch_at(self, times_s: FloatArray) -> FloatArray:
        """Return the pitch [rad], shape (n,), positive with the front down."""
        known = np.array(self._rows)
        return np.asarray(np.interp(times_s, known[:, 0], known[:, 4]), np.float64)
