"""The speed limit at a place: the robot's own, the speed masks', and the braking distance to the goal."""

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.navigation.costmap.filters import Masks, speed_fractions
from thumper.navigation.speed_limits import SpeedLimits, stoppable_speed

PERIOD_S = 0.1
BRAKE_FRACTION = 0.8  # of the deceleration is planned; the rest corrects errors


class SpeedLimiter:
    """Returns the highest forward speed by place and remaining distance."""

    def __init__(self, limits: SpeedLimits, *, approach_m_s: float, masks: Masks = ()) -> None:
        self._limits = limits
        self._approach_m_s = approach_m_s
        self.masks = masks

    def limit_m_s(self, map_from_base: Pose2, path_m: FloatArray | None, remaining_m: float) -> float:
        """Return the limit [m/s], never below the approach speed; `path_m` has shape (n, 2), or is None."""
        fastest_m_s = self._limits.v_max_m_s
        if self.masks:
            place_m = np.array((map_from_base.x_m, map_from_base.y_m))
            fastest_m_s = self._zone_limit_m_s(place_m, path_m)
        delay_s = self._limits.latency_s + PERIOD_S  # a command holds for one period
        stoppable_m_s = stoppable_speed(remaining_m, BRAKE_FRACTION * self._limits.v_accel_m_s2, delay_s)
        return max(self._approach_m_s, min(fastest_m_s, stoppable_m_s))

    def travel_time_s(self, path_m: FloatArray) -> float:
        """Return the time that a path, shape (n, 2) [m], takes at the highest speeds allowed along it."""
        steps_m = np.hypot(*np.diff(path_m, axis=0).T)
        fractions = speed_fractions(self.masks, path_m[1:])
        speeds_m_s = np.maximum(self._approach_m_s, self._limits.v_max_m_s * fractions)
        return float((steps_m / speeds_m_s).sum())

    def _zone_limit_m_s(self, place_m: FloatArray, path_m: FloatArray | None) -> float:
        """Return the limit that lets the robot enter every slow zone ahead at the zone's speed.

        Solves distance = v latency + (v^2 - zone^2) / (2 accel) for every point of the path.
        """
        limits = self._limits
        here_m_s = limits.v_max_m_s * float(speed_fractions(self.masks, place_m[None, :])[0])
        if path_m is None:
            return here_m_s
        distances_m = np.cumsum(np.hypot(*np.diff(np.vstack((place_m, path_m)), axis=0).T))
        zones_m_s = limits.v_max_m_s * speed_fractions(self.masks, path_m)
        delay = limits.v_accel_m_s2 * limits.latency_s
        ahead_m_s = np.sqrt(delay * delay + zones_m_s**2 + 2.0 * limits.v_accel_m_s2 * distances_m) - delay
        return min(here_m_s, float(np.maximum(ahead_m_s, zones_m_s).min()))
