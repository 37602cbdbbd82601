"""Whether somebody who watches over the robot is still there. Pure."""

MAX_SOURCES = 64


class HeartbeatMonitor:
    """The newest heartbeat of each source. A source that never had one is not watched over by anybody."""

    def __init__(self, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._newest_s: dict[str, float] = {}
        self._watched = ""  # the source that was asked for last: it must not be forgotten

    def record(self, source: str, at_s: float) -> None:
        """Note a heartbeat; of too many sources the one that was silent longest is forgotten."""
        self._newest_s[source] = at_s
        if len(self._newest_s) > MAX_SOURCES:
            others = self._newest_s.keys() - {self._watched}
            del self._newest_s[min(others, key=self._newest_s.__getitem__)]

    def is_lost(self, source: str, now_s: float) -> bool:
        """Whether a source that had heartbeats has none any more."""
        self._watched = source
        newest_s = self._newest_s.get(source)
        return newest_s is not None and now_s - newest_s > self._timeout_s
