"""Decides when a leg may start: a plan needs a map, and old data shows neither the pose nor the board."""

from thumper.common.errors import ThumperError
from thumper.runtime.sensor_inputs import SensorInputs

FIRST_SCANS_TIMEOUT_S = 5.0
CATCH_UP_CYCLES = 10  # a lidar that was not read must be restarted; a dead one ends the drive later


class StartGate:
    """Ask it before each cycle until it is open. Between cycles the robot does not move."""

    def __init__(self, inputs: SensorInputs) -> None:
        self._inputs = inputs
        self._is_behind = inputs.is_outdated  # the caller paused: data waits in the ports
        self._cycles = 0
        self._since_s: float | None = None  # the first time stamp after catching up

    def is_open(self) -> bool:
        """Return whether the ports are drained and the first scans are mapped.

        Raises
        ------
        ThumperError
            The lidar sends no usable scans.
        """
        inputs = self._inputs
        if self._is_behind:
            is_drained = self._cycles > 0 and inputs.is_current
            self._is_behind = not is_drained and self._cycles < CATCH_UP_CYCLES
            self._cycles += 1
        if self._is_behind:
            return False
        if inputs.has_map:
            return True
        state = inputs.estimator.state()
        if state is None:
            return False
        self._since_s = state.time_s if self._since_s is None else self._since_s
        if state.time_s - self._since_s > FIRST_SCANS_TIMEOUT_S:
            raise ThumperError(
                "the lidar sends no scans that match the board's clock; is it powered, and on the same "
                "robot? `thumper doctor --lidar PORT` shows more"
            )
        return False
