"""From a device's counter to the host's clock, by the smallest delay seen (the clock filter of NTP)."""


class ClockFilter:
    """Maps a wrapping device counter to host seconds.

    Every message is late by its own delay, never early: the smallest `host - device` seen is the best
    estimate of the offset. It is forgotten at `drift_s_per_s`, above any crystal's error, to follow drift.
    """

    def __init__(self, *, tick_s: float, wrap_ticks: int, drift_s_per_s: float = 1e-3) -> None:
        self._tick_s = tick_s
        self._wrap_ticks = wrap_ticks
        self._drift_s_per_s = drift_s_per_s
        self._last_ticks: int | None = None
        self._device_s = 0.0
        self._offset_s = 0.0

    def host_time_s(self, device_ticks: int, received_s: float) -> float:
        """Return when the device took the stamp, on the host's clock; `received_s` is when it arrived."""
        if self._last_ticks is None:
            self._offset_s = received_s
        else:
            step_s = ((device_ticks - self._last_ticks) % self._wrap_ticks) * self._tick_s
            self._device_s += step_s
            self._offset_s = min(self._offset_s + self._drift_s_per_s * step_s, received_s - self._device_s)
        self._last_ticks = device_ticks
        return self._device_s + self._offset_s
