"""What one cycle of navigation decides."""

import logging
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from thumper.common.geometry import FloatArray, Twist2

MOST = 1000  # a robot that drives for days must not fill its memory with words

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Transition:
    """One change of state; a recovery that follows another is one too."""

    time_s: float
    before: str  # a `NavigationState`'s value; empty at the very first
    after: str
    reason: str  # in words; names the recovery and why it began


class TransitionLog:
    """Keeps the newest changes, tells them to a listener and the logger `thumper.navigation.transitions`."""

    def __init__(self, listener: Callable[[Transition], None] | None = None) -> None:
        self._listener = listener
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
        if self._listener is not None:
            try:
                self._listener(entry)
            except Exception:
                # Whoever listens must not be able to stop the robot's control.
                log.exception("the listener to transitions has failed")


class NavigationState(Enum):
    """What the navigator is doing. FAILED and REACHED are final until the next goal."""

    IDLE = "idle"
    NAVIGATING = "navigating"
    ROTATING = "rotating"
    RECOVERING = "recovering"
    REACHED = "reached"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NavigationOutput:
    """What one cycle decided."""

    command: Twist2 = field(default_factory=Twist2)
    state: NavigationState = NavigationState.IDLE
    reason: str = ""  # in words: why it stands, recovers or failed; empty when all is well
    plan: FloatArray = field(default_factory=lambda: np.empty((0, 2)))  # (n, 2) [m] in map, from the robot on
    local_plan: FloatArray = field(default_factory=lambda: np.empty((0, 3)))  # (m, 3) x, y, theta in map
