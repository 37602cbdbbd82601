"""Convert a lidar's wrapping millisecond clock to the host's clock."""

import math

from thumper.common.clock_slip import ClockSlip

WINDOW_S = 15.0
"""Long enough for the phase between a lidar at 10.2 Hz and a host that reads at 10 Hz to cycle once."""

STREAM_WINDOW_S = 1.0
"""For lidars that send packets every few milliseconds: one in a second is hardly delayed, and a clock that is
0.5 % off drifts by 5 ms in that time."""

JUMP_S = 10.0
"""The clocks diverge by this much in one step only after a restart of the lidar, which starts at 0 again."""

MAX_LATE_S = 0.25
"""A scan may wait this long for the host, after the delay that every scan has."""

MAX_EARLY_S = 0.05
"""No scan arrives before it is complete; the crystals differ by much less than this."""


class MinimumLag:
    """The smallest lag over the last one to two windows, and its change since the first window."""

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._window_end_s: float | None = None
        self._window_minimum_s = math.inf
        self._previous_minimum_s = math.inf
        self._reference_s: float | None = None

    @property
    def minimum_s(self) -> float:
        """Smallest lag in this window and the one before."""
        return min(self._previous_minimum_s, self._window_minimum_s)

    @property
    def change_s(self) -> float:
        """`minimum_s` minus that of the first window; 0 until the first window is complete."""
        return 0.0 if self._reference_s is None else self.minimum_s - self._reference_s

    def add(self, device_s: float, lag_s: float) -> None:
        """Add the lag of a scan with the stamp `device_s`; stamps must not decrease."""
        if self._window_end_s is None:
            self._window_end_s = device_s + self._window_s
        elif device_s > self._window_end_s:
            if self._reference_s is None:
                self._reference_s = self._window_minimum_s
            self._previous_minimum_s = self._window_minimum_s
            self._window_minimum_s = math.inf
            self._window_end_s = device_s + self._window_s
        self._window_minimum_s = min(self._window_minimum_s, lag_s)


class ClockSync:
    """Maps device stamps to host seconds.

    A scan reaches the host up to 0.2 s after its stamp: one revolution of the head, and the time until the
    host reads it. `sync`, with a reply that the device sent at once, measures the offset itself. After that,
    the smallest lag of recent scans is only watched for change, which is the drift between the two crystals.
    If all scans of two seconds are later than that, the offset was wrong or the clock stopped: the
    mapping follows.
    Without `sync`, the offset is the smallest lag minus `least_lag_s`, the delay that every scan has.
    """

    def __init__(self, *, wrap_ms: int, least_lag_s: float, window_s: float = WINDOW_S) -> None:
        self._wrap_ms = wrap_ms
        self._least_lag_s = least_lag_s
        self._window_s = window_s
        self._offset_s: float | None = None  # host - device, from `sync`
        self._unwrapped_ms = 0
        self._last_ms: int | None = None
        self._last_received_s = 0.0
        self._lags = MinimumLag(self._window_s)
        self._slip = ClockSlip(MAX_LATE_S)

    def sync(self, stamp_ms: int, sent_s: float, received_s: float) -> None:
        """Set the offset from one reply: the device read `stamp_ms` between the two host times."""
        device_s = self._unwrap(stamp_ms, received_s)
        self._offset_s = 0.5 * (sent_s + received_s) - device_s

    def host_time_s(self, stamp_ms: int, received_s: float) -> float:
        """Return the host time of a scan's stamp; `received_s` is when the scan arrived."""
        device_s = self._unwrap(stamp_ms, received_s)
        self._lags.add(device_s, received_s - device_s)
        late_s = received_s - self._least_lag_s - self._mapped_s(device_s)
        slip_s = self._slip.update(received_s, late_s)
        if slip_s > 0.0 or late_s < -MAX_EARLY_S:
            self._follow(device_s, received_s, slip_s if slip_s > 0.0 else late_s)
        return self._mapped_s(device_s)

    def _mapped_s(self, device_s: float) -> float:
        if self._offset_s is None:
            return device_s + self._lags.minimum_s - self._least_lag_s
        return device_s + self._offset_s + self._lags.change_s

    def _follow(self, device_s: float, received_s: float, slip_s: float) -> None:
        """Shift the mapping by `slip_s`, from this scan on."""
        if self._offset_s is not None:
            self._offset_s += self._lags.change_s + slip_s
        self._lags = MinimumLag(self._window_s)
        self._lags.add(device_s, received_s - device_s)

    def _unwrap(self, stamp_ms: int, received_s: float) -> float:
        if self._last_ms is not None:
            step_ms = (stamp_ms - self._last_ms) % self._wrap_ms
            if abs(1e-3 * step_ms - (received_s - self._last_received_s)) > JUMP_S:
                self._offset_s = None  # no longer valid: the lidar has restarted
                self._lags = MinimumLag(self._window_s)
            self._unwrapped_ms += step_ms
        self._last_ms = stamp_ms
        self._last_received_s = received_s
        return 1e-3 * self._unwrapped_ms
