"""From a lidar's wrapping millisecond clock to the host's clock."""

import math

WINDOW_S = 15.0
"""Long enough for the phase between a lidar at 10.2 Hz and a host that looks at 10 Hz to go round."""

JUMP_S = 10.0
"""Clocks part by this much in one step only if the lidar was restarted: its own begins at 0 again."""


class MinimumLag:
    """The smallest lag of the last one to two windows, and how it has changed since the first one."""

    def __init__(self) -> None:
        self._window_end_s: float | None = None
        self._window_least_s = math.inf
        self._before_least_s = math.inf
        self._reference_s: float | None = None

    @property
    def least_s(self) -> float:
        """The smallest lag of this window and the one before."""
        return min(self._before_least_s, self._window_least_s)

    @property
    def change_s(self) -> float:
        """`least_s` against that of the first window; 0 until the first window is over."""
        return 0.0 if self._reference_s is None else self.least_s - self._reference_s

    def add(self, device_s: float, lag_s: float) -> None:
        """Take the lag of a scan stamped at `device_s`, which never goes back."""
        if self._window_end_s is None:
            self._window_end_s = device_s + WINDOW_S
        elif device_s > self._window_end_s:
            if self._reference_s is None:
                self._reference_s = self._window_least_s
            self._before_least_s = self._window_least_s
            self._window_least_s = math.inf
            self._window_end_s = device_s + WINDOW_S
        self._window_least_s = min(self._window_least_s, lag_s)


class ClockSync:
    """Maps device stamps to host seconds.

    A scan reaches the host later than it was stamped, by a turn of the head and by the time until the host
    looks: up to 0.2 s. `sync`, with an answer that came at once, gives the offset itself. After it the
    smallest lag of the last scans is only watched for change, which is the drift between the two crystals.
    Without `sync` the smallest lag less `least_lag_s`, which no scan can beat, has to serve.
    """

    def __init__(self, *, wrap_ms: int, least_lag_s: float) -> None:
        self._wrap_ms = wrap_ms
        self._least_lag_s = least_lag_s
        self._offset_s: float | None = None  # host - device, from `sync`
        self._unwrapped_ms = 0
        self._last_ms: int | None = None
        self._last_received_s = 0.0
        self._lags = MinimumLag()

    def sync(self, stamp_ms: int, asked_s: float, answered_s: float) -> None:
        """Take one answer to the question for the device's clock: `stamp_ms`, read between the two times."""
        device_s = self._unwrap(stamp_ms, answered_s)
        self._offset_s = 0.5 * (asked_s + answered_s) - device_s

    def host_time_s(self, stamp_ms: int, received_s: float) -> float:
        """Return when the scan that came at `received_s` was stamped, on the host's clock."""
        device_s = self._unwrap(stamp_ms, received_s)
        self._lags.add(device_s, received_s - device_s)
        if self._offset_s is None:
            return device_s + self._lags.least_s - self._least_lag_s
        return device_s + self._offset_s + self._lags.change_s

    def _unwrap(self, stamp_ms: int, received_s: float) -> float:
        if self._last_ms is not None:
            step_ms = (stamp_ms - self._last_ms) % self._wrap_ms
            if abs(1e-3 * step_ms - (received_s - self._last_received_s)) > JUMP_S:
                self._offset_s = None  # it holds no longer
                self._lags = MinimumLag()
            self._unwrapped_ms += step_ms
        self._last_ms = stamp_ms
        self._last_received_s = received_s
        return 1e-3 * self._unwrapped_ms
