"""What the navigator did, and why: every change of state with its time and reason."""

import logging
from collections import deque
from dataclasses import dataclass

MOST = 1000  # a robot that drives for days must not fill its memory with words

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Transition:
    """One change."""

    time_s: float
    before: str
    after: str
    reason: str


class TransitionLog:
    """Keeps the newest changes and tells them to the logger `thumper.navigation.transitions`."""

    def __init__(self) -> None:
        self.entries: deque[Transition] = deque(maxlen=MOST)
        self._state, self._told = "", ""

    def note(self, time_s: float, state: str, reason: str, told: str) -> None:
        """Take the state of a cycle; an entry is made when the state, or what it is `told` to do, has
        changed.
        """
        if (state, told) == (self._state, self._told):
            return
        entry = Transition(time_s=time_s, before=self._state, after=state, reason=reason)
        self._state, self._told = state, told
        self.entries.append(entry)
        log.info("%.1f s: %s -> %s: %s", entry.time_s, entry.before or "start", entry.after, entry.reason)
