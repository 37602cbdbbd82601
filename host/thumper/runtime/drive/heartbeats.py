"""Detects clients that stop sending heartbeats. Pure."""

MAX_SOURCES = 64
TIMEOUT_S = 0.3  # six heartbeats of the page; the safety chain allows 0.5 s in all


class HeartbeatMonitor:
    """Keeps the time of each source's last heartbeat. A source that never sent one is not monitored."""

    def __init__(self, timeout_s: float = TIMEOUT_S) -> None:
        self._timeout_s = timeout_s
        self._last_s: dict[str, float] = {}
        self._monitored = ""  # the source of the last `is_lost` call: it must not be forgotten

    def record(self, source: str, at_s: float) -> None:
        """Record a heartbeat; with too many sources, forget the one that has been silent longest."""
        self._last_s[source] = at_s
        if len(self._last_s) > MAX_SOURCES:
            others = self._last_s.keys() - {self._monitored}
            del self._last_s[min(others, key=self._last_s.__getitem__)]

    def is_lost(self, source: str, now_s: float) -> bool:
        """Return whether a source that sent heartbeats has stopped sending them."""
        self._monitored = source
        last_s = self._last_s.get(source)
        return last_s is not None and now_s - last_s > self._timeout_s
