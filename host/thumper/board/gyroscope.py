"""The board's gyroscope: from the heading in its telemetry to increments, and whether there is one."""

import math

from thumper.board.messages import GyroscopeState, Telemetry
from thumper.common.errors import EXIT_NOT_THERE, ThumperError

RAD_PER_COUNT = math.tau / 2**16


class GyroIncrements:
    """Differences of the heading in a stream of telemetry.

    The telemetry carries the heading and not the increment, so that a lost message loses no rotation: the
    increment then spans two control ticks, as the counts do. It is exact below half a revolution.
    """

    def __init__(self) -> None:
        self._heading: int | None = None

    def add(self, telemetry: Telemetry) -> float | None:
        """Return the rotation [rad] since the message before; None unless both have a valid heading."""
        valid = telemetry.gyroscope is GyroscopeState.READY
        last, self._heading = self._heading, telemetry.heading if valid else None
        if last is None or self._heading is None:
            return None
        return RAD_PER_COUNT * ((self._heading - last + 2**15) % 2**16 - 2**15)


def check_gyroscope(state: GyroscopeState) -> None:
    """Raise ThumperError if the board has no gyroscope in use, or none answers (exit code 3)."""
    if state is GyroscopeState.OFF:
        raise ThumperError(
            "the board does not use its gyroscope: start with [imu] enabled = false, set gyroscope to 1 "
            "(z axis up) or 2 (down) on the dashboard under Gains, save it, and enable [imu] again",
            exit_code=EXIT_NOT_THERE,
        )
    if state is GyroscopeState.MISSING:
        raise ThumperError(
            "no MPU-6050 answers on the board: check SDA at A4, SCL at A5 and AD0 low, "
            "or set [imu] enabled = false",
            exit_code=EXIT_NOT_THERE,
        )
