"""Watch for a lost pose and for frozen odometry: with either the robot would drive blind."""

from thumper.common.geometry import Twist2
from thumper.navigation.recovery.progress_checker import ProgressOptions
from thumper.navigation.state import Stop

# Arm that converts a turn rate to a speed, to compare rotations with translations. Between the Wild Thumper's
# half width (0.12 m) and its effective half track (0.18 m): the thresholds below need no exact value.
TURN_ARM_M = 0.15
LEAST_M_S = 0.03  # slower commands may not move the base
MOVING_FRACTION = 0.2  # of the commanded speed


class MotionWatchdog:
    """Checks that the pose is known and that the odometry moves when the wheels are commanded to turn."""

    def __init__(self, options: ProgressOptions) -> None:
        self._options = options
        self._frozen_since_s: float | None = None
        self._lost_since_s: float | None = None

    def reset(self) -> None:
        """Forget the past (a new goal)."""
        self._frozen_since_s = self._lost_since_s = None

    def check(self, time_s: float, command: Twist2, measured: Twist2, lost: str) -> Stop | None:
        """Return why the robot must stop, or None.

        `command` has been active since the last call; `lost` says why the pose is not trusted, if it is not.
        """
        if self._is_frozen(time_s, command, measured):
            return Stop(
                reason=f"the odometry has not moved for {self._options.frozen_s:.0f} s although the wheels "
                "were commanded to turn: check wheels, motors and encoders",
                final=True,
            )
        if not lost:
            self._lost_since_s = None
            return None
        self._lost_since_s = time_s if self._lost_since_s is None else self._lost_since_s
        if time_s - self._lost_since_s >= self._options.lost_s:
            return Stop(reason=f"the robot's pose is lost: {lost}", final=True)
        return Stop(reason=f"stopped until the pose is known again: {lost}")

    def _is_frozen(self, time_s: float, command: Twist2, measured: Twist2) -> bool:
        commanded_m_s = abs(command.v_m_s) + TURN_ARM_M * abs(command.w_rad_s)
        measured_m_s = abs(measured.v_m_s) + TURN_ARM_M * abs(measured.w_rad_s)
        if commanded_m_s < LEAST_M_S or measured_m_s > MOVING_FRACTION * commanded_m_s:
            self._frozen_since_s = None
            return False
        self._frozen_since_s = time_s if self._frozen_since_s is None else self._frozen_since_s
        return time_s - self._frozen_since_s >= self._options.frozen_s
