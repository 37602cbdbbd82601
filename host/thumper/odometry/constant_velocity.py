"""Predict the motion between scans from the scans before: a replacement for missing odometry."""

from thumper.common.geometry import Pose2

MAX_CHANGE_M, MAX_CHANGE_RAD = 0.25, 0.4  # of the motion between two scans


class ConstantVelocityOdometry:
    """Replaces missing odometry: predicts the same motion as between the previous two scans."""

    def __init__(self) -> None:
        self._odom_from_base = Pose2()
        self._map_from_base: Pose2 | None = None
        self._step = Pose2()

    def predict(self) -> Pose2:
        """Return `odom_from_base` of the next scan."""
        self._odom_from_base = self._odom_from_base @ self._step
        return self._odom_from_base

    def correct(self, map_from_base: Pose2) -> None:
        """Update the motion with the matched pose of that scan."""
        if self._map_from_base is not None:
            step = self._map_from_base.inverse() @ map_from_base
            # A loop closure moves the map and the pose with it, which is no motion of the robot.
            change_m, change_rad = step.distance_m(self._step), abs(step.theta_rad - self._step.theta_rad)
            if change_m < MAX_CHANGE_M and change_rad < MAX_CHANGE_RAD:
                self._step = step
        self._map_from_base = map_from_base
