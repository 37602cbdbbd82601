"""Questions that take the board several requests: asked bit by bit, once a beat's order to the wheels is out.

A request and its answer take a millisecond or two, behind a slow USB adapter sixteen: to ask for everything
in one go could hold up the loop for nearly as long as the board waits for an order (0.3 s).
"""

from collections import deque
from collections.abc import Callable, Generator
from typing import Any

from thumper.common.errors import ThumperError
from thumper.runtime.requests import Query

TIME_SLICE_S = 0.02  # of a beat's 0.1 s; a beat's own work takes as much again
MAX_PENDING = 20

BoardJob = Generator[None, None, dict[str, Any]]
"""Yields after each request to the board and returns the answer; raises ThumperError when there is none."""


class BoardJobQueue:
    """One after another, in the robot's loop."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[Query, BoardJob]] = deque()

    def __bool__(self) -> bool:
        """Whether any is still to be done."""
        return bool(self._waiting)

    def add(self, ask: Query, job: BoardJob) -> None:
        """Have it done in the beats that follow, and `ask` answered then; ThumperError when too many wait."""
        if len(self._waiting) >= MAX_PENDING:
            raise ThumperError("too many questions to the board wait already: ask again")
        self._waiting.append((ask, job))

    def run_for(self, now_s: Callable[[], float]) -> None:
        """Make one request, and more while the beat's share of time lasts; `now_s` is the board's clock."""
        until_s = now_s() + TIME_SLICE_S
        while self._waiting:
            ask, job = self._waiting[0]
            try:
                next(job)
            except StopIteration as done:
                self._finish(ask, {"ok": True, **done.value})
            except ThumperError as error:
                self._finish(ask, {"ok": False, "error": str(error)})
            except Exception as error:  # a question must not end the robot's loop
                self._finish(ask, {"ok": False, "error": f"internal error: {type(error).__name__}: {error}"})
            if now_s() >= until_s:
                return

    def refuse(self, why: str) -> None:
        """Do nothing more of what waits, and say so."""
        while self._waiting:
            self._finish(self._waiting[0][0], {"ok": False, "error": why})

    def _finish(self, ask: Query, answer: dict[str, Any]) -> None:
        self._waiting.popleft()
        ask.reply(answer)
