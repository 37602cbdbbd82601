"""Whether the robot still knows where it is and whether it moves; without that it would drive blind."""

from thumper.common.geometry import Twist2
from thumper.navigation.recovery.progress_checker import ProgressOptions

ARM_M = 0.15  # half the track, about: makes a turn comparable with a speed
LEAST_M_S = 0.03  # slower commands may well not move the base
MOVING_PART = 0.2  # of the speed that is asked for


class MotionWatchdog:
    """Watches for a lost position, and for odometry that stands although the wheels are told to turn."""

    def __init__(self, options: ProgressOptions) -> None:
        self._options = options
        self.reset()

    def reset(self) -> None:
        """Begin afresh (a new goal)."""
        self._still_since_s: float | None = None
        self._lost_since_s: float | None = None

    def objection(self, time_s: float, command: Twist2, measured: Twist2, lost: str) -> tuple[str, bool]:
        """Return (why the robot must stand, whether that is the end); empty when all is well.

        `command` is the one that has held since the last call, `lost` why the pose cannot be trusted.
        """
        if self._is_frozen(time_s, command, measured):
            for_s = f"{self._options.frozen_s:.0f} s"
            return (
                f"the odometry has not moved for {for_s} although the wheels were told to turn: look at "
                "wheels, motors and encoders"
            ), True
        if not lost:
            self._lost_since_s = None
            return "", False
        self._lost_since_s = time_s if self._lost_since_s is None else self._lost_since_s
        if time_s - self._lost_since_s >= self._options.lost_s:
            return f"the robot does not know where it is: {lost}", True
        return f"standing until the position is known again: {lost}", False

    def _is_frozen(self, time_s: float, command: Twist2, measured: Twist2) -> bool:
        asked_m_s = abs(command.v_m_s) + ARM_M * abs(command.w_rad_s)
        moved_m_s = abs(measured.v_m_s) + ARM_M * abs(measured.w_rad_s)
        if asked_m_s < LEAST_M_S or moved_m_s > MOVING_PART * asked_m_s:
            self._still_since_s = None
            return False
        self._still_since_s = time_s if self._still_since_s is None else self._still_since_s
        return time_s - self._still_since_s >= self._options.frozen_s
