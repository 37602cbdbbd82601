"""Keeps a robot from swinging left and right on one spot: the flags of ROS's oscillation cost."""

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2, wrap_angle

SLOWEST_RAD_S = 0.05


class OscillationFlags:
    """Remembers the last reversal."""

    def __init__(self, reset_m: float, reset_rad: float) -> None:
        """After a reversal, turning back is forbidden until the robot has moved or turned this far."""
        self._reset_m, self._reset_rad = reset_m, reset_rad
        self.reset()

    def reset(self) -> None:
        """Forget."""
        self._side = 0.0  # of the turn last driven
        self._forbidden = 0.0
        self._since = Pose2()

    def allowed(self, commands: FloatArray) -> NDArray[np.bool_]:
        """Which commands (v, w), shape (n, 2), do not swing back."""
        if self._forbidden == 0.0:
            return np.ones(len(commands), np.bool_)
        mask: NDArray[np.bool_] = commands[:, 1] * self._forbidden < SLOWEST_RAD_S
        return mask

    def update(self, w_rad_s: float, map_from_base: Pose2) -> None:
        """Take the command that was chosen."""
        moved = map_from_base.distance_m(self._since) > self._reset_m
        turned_rad = abs(wrap_angle(map_from_base.theta_rad - self._since.theta_rad))
        if moved or turned_rad > self._reset_rad:
            self._forbidden = 0.0
        if abs(w_rad_s) < SLOWEST_RAD_S:
            return
        side = 1.0 if w_rad_s > 0.0 else -1.0
        if side * self._side < 0.0:
            self._forbidden, self._since = -side, map_from_base
        self._side = side
