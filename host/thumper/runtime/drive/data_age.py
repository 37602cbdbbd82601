"""Decides whether scans and telemetry are recent enough to drive on. Pure."""

import math

from thumper.runtime.sensor_inputs import BLIND_S
from thumper.runtime.state_estimator import RobotState

SCAN_TIMEOUT_S = 1.0  # after BLIND_S without a scan the robot waits; after this long the lidar is lost
TELEMETRY_S = 0.3  # by then the firmware stops the motors for lack of commands
WAIT_LIMIT_S = 5.0
LIDAR_LOST = "the lidar stopped sending scans; check its cable"


def waits_for_scan(state: RobotState) -> str:
    """Return that the newest scan is too old to drive on; empty if it is not."""
    age_s = state.scan_age_s
    return f"waiting for the lidar: its newest scan is {age_s:.2f} s old" if age_s > BLIND_S else ""


class DataAge:
    """Ask `problem` before each command of a drive. While there is one the robot waits, but not for ever."""

    def __init__(self) -> None:
        self._since_s: float | None = None  # when the present wait began
        self._time_s = math.nan  # of the newest state
        self._cycle_s = 0.0  # between the two newest states

    def problem(self, state: RobotState, now_s: float) -> str:
        """Return why the robot must not move now, on the clock `now_s` of the board; empty if it may."""
        if state.time_s > self._time_s:
            self._cycle_s = state.time_s - self._time_s
        self._time_s = state.time_s
        telemetry_age_s = now_s - state.time_s
        is_lidar_lost = state.scan_age_s > SCAN_TIMEOUT_S
        # A scan is mapped once telemetry covers it: after a slow cycle the lidar is not to blame for its age.
        late_s = max(telemetry_age_s, self._cycle_s if is_lidar_lost else 0.0)
        problem = ""
        if late_s > TELEMETRY_S:
            problem = f"waiting: this computer is overloaded, the data is {late_s:.2f} s old"
        elif is_lidar_lost:
            problem = LIDAR_LOST
        else:
            problem = waits_for_scan(state)
        if not problem:
            self._since_s = None
        elif self._since_s is None:
            self._since_s = state.time_s
        return problem

    def is_hopeless(self, state: RobotState) -> bool:
        """Return whether the wait has lasted too long, or the lidar is lost."""
        waited_s = 0.0 if self._since_s is None else state.time_s - self._since_s
        return state.scan_age_s > SCAN_TIMEOUT_S or waited_s > WAIT_LIMIT_S
