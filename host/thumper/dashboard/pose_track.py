"""Where the robot was a moment ago, so that each ray of a scan is drawn from where it was taken."""

from collections import deque

import numpy as np

from thumper.common.geometry import FloatArray, Pose2

KEPT_POSES = 30  # three seconds at 10 Hz; a scan is a tenth of a second old


class PoseTrack:
    """The newest poses `map_from_base` with their times."""

    def __init__(self) -> None:
        self._poses: deque[tuple[float, Pose2]] = deque(maxlen=KEPT_POSES)

    def add(self, time_s: float, map_from_base: Pose2) -> None:
        """Note a pose; one that is older than the newest begins a new track: the clock was set back."""
        if self._poses and time_s <= self._poses[-1][0]:
            self._poses.clear()
        self._poses.append((time_s, map_from_base))

    def in_map(self, points_in_base_m: FloatArray, times_s: FloatArray) -> FloatArray:
        """Take points, shape (n, 2), each seen at its own time, shape (n,), to the map; empty without poses.

        Before the first and after the last pose the robot stands, as far as is known.
        """
        if not self._poses:
            return np.empty((0, 2))
        known_s = np.array([time_s for time_s, _ in self._poses])
        x_m = np.interp(times_s, known_s, [pose.x_m for _, pose in self._poses])
        y_m = np.interp(times_s, known_s, [pose.y_m for _, pose in self._poses])
        headings_rad = np.unwrap([pose.theta_rad for _, pose in self._poses])
        theta_rad = np.interp(times_s, known_s, headings_rad)
        cos, sin = np.cos(theta_rad), np.sin(theta_rad)
        return np.column_stack(
            (
                x_m + cos * points_in_base_m[:, 0] - sin * points_in_base_m[:, 1],
                y_m + sin * points_in_base_m[:, 0] + cos * points_in_base_m[:, 1],
            )
        )
