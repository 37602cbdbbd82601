"""Prevent a robot from swinging left and right in place: the flags of ROS's oscillation cost function."""

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2, wrap_angle

SLOWEST_RAD_S = 0.05
RESET_M, RESET_RAD = 0.05, 0.2  # moved or turned this far, the robot may turn back again


class OscillationFlags:
    """Remembers the last reversal of the turn and forbids turning back."""

    def __init__(self) -> None:
        self._side = 0.0  # of the last turn
        self._forbidden = 0.0
        self._reversed_at = Pose2()

    def reset(self) -> None:
        """Forget the last reversal."""
        self._side = 0.0
        self._forbidden = 0.0
        self._reversed_at = Pose2()

    def allowed(self, commands: FloatArray) -> NDArray[np.bool_]:
        """Return which commands (v, w), shape (n, 2), do not swing back."""
        if self._forbidden == 0.0:
            return np.ones(len(commands), np.bool_)
        mask: NDArray[np.bool_] = commands[:, 1] * self._forbidden < SLOWEST_RAD_S
        return mask

    def update(self, w_rad_s: float, map_from_base: Pose2) -> None:
        """Update the flags with the chosen turn rate."""
        moved = map_from_base.distance_m(self._reversed_at) > RESET_M
        turned_rad = abs(wrap_angle(map_from_base.theta_rad - self._reversed_at.theta_rad))
        if moved or turned_rad > RESET_RAD:
            self._forbidden = 0.0
        if abs(w_rad_s) < SLOWEST_RAD_S:
            return
        side = 1.0 if w_rad_s > 0.0 else -1.0
        if side * self._side < 0.0:
            self._forbidden, self._reversed_at = -side, map_from_base
        self._side = side
