"""Rejects requests that queued while the process hung or was stopped. Pure.

The sender has long stopped waiting: a goal from a minute ago must not start a drive now.
"""

from thumper.ros import services
from thumper.runtime.requests import GoTo, Query, Request, RobotCommand

STALL_S = 2.0  # after this long without a cycle, no sender waits for an answer any more
STALE_PERIOD_S = 1.0  # requests that were in transit during the stall arrive within this time
STARTING_COMMANDS = frozenset({"arm", "explore", "dock", "undock"})
STALE_REQUEST = "rejected: the robot's process hung since this request was sent; send it again"


class StallGuard:
    """Call `is_stale` once per cycle."""

    def __init__(self) -> None:
        self._last_s: float | None = None
        self._stale_until_s = 0.0

    def is_stale(self, now_s: float) -> bool:
        """Return whether requests received now may have waited while the process hung."""
        if self._last_s is not None and now_s - self._last_s > STALL_S:
            self._stale_until_s = now_s + STALE_PERIOD_S
        self._last_s = now_s
        return now_s < self._stale_until_s


def starts_motion(request: Request) -> bool:
    """Return whether the request can set a stationary robot in motion.

    A manual command cannot: the robot must be armed first.
    """
    match request:
        case GoTo():
            return True
        case RobotCommand():
            return request.name in STARTING_COMMANDS
        case Query(
            name=services.MISSION_SEND.name | services.MISSION_FOLLOW.name | services.EXPERIMENT_START.name
        ):
            return True
        case Query(name=services.COMMAND.name):
            return request.content.get("command") in STARTING_COMMANDS
    return False
