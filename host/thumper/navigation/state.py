"""State and output of the navigator, and the log of its transitions."""

import logging
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.maps.occupancy_grid import OccupancyGrid

MAX_TRANSITIONS = 1000  # a robot that drives for days must not fill its memory

log = logging.getLogger(__name__)


class NavigationState(Enum):
    """What the navigator is doing. FAILED and REACHED are final until the next goal."""

    IDLE = "idle"
    NAVIGATING = "navigating"
    ROTATING = "rotating"
    RECOVERING = "recovering"
    REACHED = "reached"
    FAILED = "failed"


class ScanFrames(NamedTuple):
    """Where the robot was when the newest scan was taken, and where the map has the odometry."""

    map_from_base: Pose2
    map_from_odom: Pose2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CycleInput:
    """What the navigator knows in one cycle."""

    time_s: float
    map_from_base: Pose2
    twist: Twist2  # measured
    grid: OccupancyGrid
    hits_in_map_m: FloatArray  # shape (n, 2), of the newest scan
    scan_pose: Pose2  # map_from_base when that scan was taken
    map_from_odom: Pose2
    lost: str  # why the pose is not trusted; empty if it is
    period_s: float  # since the last cycle, within sensible limits


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop:
    """Why the robot must stop."""

    reason: str
    final: bool = False  # the drive has failed


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NavigationOutput:
    """The result of one cycle."""

    command: Twist2 = field(default_factory=Twist2)
    state: NavigationState = NavigationState.IDLE
    reason: str = ""  # why the robot is stopped, recovers or failed; empty in normal operation
    plan: FloatArray = field(default_factory=lambda: np.empty((0, 2)))  # (n, 2) [m] in map, from the robot on
    local_plan: FloatArray = field(default_factory=lambda: np.empty((0, 3)))  # (m, 3) x, y, theta in map


@dataclass(frozen=True, slots=True, kw_only=True)
class Transition:
    """One change of state; a recovery that follows another is one, too."""

    time_s: float
    before: str  # a `NavigationState`'s value; empty at the first transition
    after: str
    reason: str  # names the recovery and its cause


class TransitionLog:
    """Keeps the newest transitions; reports them to a listener and to the log `thumper.navigation.state`."""

    def __init__(self, listener: Callable[[Transition], None] | None = None) -> None:
        self._listener = listener
        self._state, self._recovery = "", ""
        self.entries: deque[Transition] = deque(maxlen=MAX_TRANSITIONS)

    def record(self, time_s: float, state: str, reason: str, recovery: str) -> None:
        """Add an entry if the state, or the recovery that is running, has changed."""
        if (state, recovery) == (self._state, self._recovery):
            return
        entry = Transition(time_s=time_s, before=self._state, after=state, reason=reason)
        self._state, self._recovery = state, recovery
        self.entries.append(entry)
        why = f": {entry.reason}" if entry.reason else ""
        log.info("%.1f s: %s -> %s%s", entry.time_s, entry.before or "start", entry.after, why)
        if self._listener is not None:
            try:
                self._listener(entry)
            except Exception:
                # A listener must not be able to stop the control of the robot.
                log.exception("the listener to transitions has failed")
