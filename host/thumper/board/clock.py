"""Convert a device's counter to the host's clock by the smallest delay seen (the clock filter of NTP)."""

from thumper.common.clock_slip import ClockSlip

MAX_LATE_S = 0.1  # a message may wait this long for the host


class ClockFilter:
    """Maps a wrapping device counter to host seconds.

    Every message arrives late by its own delay and never early, so the smallest `host - device` seen is the
    best estimate of the offset. The estimate decays at `drift_s_per_s`, which is above the error of any
    crystal, so that it follows the drift between the two clocks. A clock that stopped is followed
    after two seconds.
    """

    def __init__(self, *, tick_s: float, wrap_ticks: int, drift_s_per_s: float = 1e-3) -> None:
        self._tick_s = tick_s
        self._wrap_ticks = wrap_ticks
        self._drift_s_per_s = drift_s_per_s
        self._last_ticks: int | None = None
        self._device_s = 0.0
        self._offset_s = 0.0
        self._slip = ClockSlip(MAX_LATE_S)

    def host_time_s(self, device_ticks: int, received_s: float) -> float:
        """Return when the device took the stamp, on the host's clock; `received_s` is the arrival time."""
        if self._last_ticks is None:
            self._offset_s = received_s
        else:
            step_s = ((device_ticks - self._last_ticks) % self._wrap_ticks) * self._tick_s
            self._device_s += step_s
            late_s = received_s - self._device_s - self._offset_s
            self._offset_s += self._slip.update(received_s, late_s)
            self._offset_s = min(self._offset_s + self._drift_s_per_s * step_s, received_s - self._device_s)
        self._last_ticks = device_ticks
        return self._device_s + self._offset_s
