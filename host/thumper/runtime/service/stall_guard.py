"""A process that hung or was stopped finds what was asked of it meanwhile, all at once. Pure.

Who asked has long stopped waiting for it: a goal of a minute ago must not set the robot going now.
"""

from thumper.runtime.requests import GoTo, Query, Request, RobotCommand

STALL_S = 2.0  # without a beat for so long, nobody waits for an answer any more
STALE_PERIOD_S = 1.0  # what was on its way then has come after this long
STALE_REQUEST = "the robot's process hung, and does not do late what was asked of it meanwhile: ask again"


class StallGuard:
    """Call `is_stale` once a beat."""

    def __init__(self) -> None:
        self._last_s: float | None = None
        self._stale_until_s = 0.0

    def is_stale(self, now_s: float) -> bool:
        """Whether what comes in now may have waited while the process hung."""
        if self._last_s is not None and now_s - self._last_s > STALL_S:
            self._stale_until_s = now_s + STALE_PERIOD_S
        self._last_s = now_s
        return now_s < self._stale_until_s


def starts_motion(request: Request) -> bool:
    """Whether the request makes a robot move that stood; a hand does not, for it must be armed first."""
    match request:
        case GoTo() | RobotCommand(name="arm"):
            return True
        case Query(name="mission/send" | "experiment/start"):
            return True
        case Query(name="command"):
            return request.content.get("command") == "arm"
    return False
