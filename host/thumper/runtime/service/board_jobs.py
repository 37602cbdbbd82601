"""Queries that need several requests to the board, spread over control cycles.

A request and its answer take a millisecond or two, or 16 ms behind a slow USB adapter. All requests in one
cycle could delay the loop for almost 0.3 s, after which the board stops the motors.
"""

from collections import deque
from collections.abc import Callable, Generator
from typing import Any, TypeVar

from thumper.common.errors import ThumperError
from thumper.ros.service import json_object
from thumper.runtime.requests import Query

TIME_SLICE_S = 0.02  # of a cycle's 0.1 s; the cycle's own work takes about as long
MAX_PENDING = 20

ReplyT = TypeVar("ReplyT")
BoardJob = Generator[None, None, ReplyT]
"""Yields after each request to the board and returns the reply; raises ThumperError if it fails."""


class BoardJobQueue:
    """Runs the jobs one after another, in the robot's loop."""

    def __init__(self) -> None:
        self._pending: deque[tuple[Query, BoardJob[Any]]] = deque()

    def __bool__(self) -> bool:
        """Return whether any job is pending."""
        return bool(self._pending)

    def add(self, query: Query, job: BoardJob[Any]) -> None:
        """Queue a job, whose result answers `query`; raise ThumperError if the queue is full."""
        if len(self._pending) >= MAX_PENDING:
            raise ThumperError("too many queries for the board are pending: ask again")
        self._pending.append((query, job))

    def run_for(self, now_s: Callable[[], float]) -> None:
        """Make one request, and more while the time slice lasts; `now_s` is the board's clock."""
        until_s = now_s() + TIME_SLICE_S
        while self._pending:
            query, job = self._pending[0]
            try:
                next(job)
            except StopIteration as done:
                self._finish(query, {"ok": True, **json_object(done.value)})
            except ThumperError as error:
                self._finish(query, {"ok": False, "error": str(error)})
            except Exception as error:  # a query must not end the robot's loop
                self._finish(
                    query, {"ok": False, "error": f"internal error: {type(error).__name__}: {error}"}
                )
            if now_s() >= until_s:
                return

    def refuse(self, reason: str) -> None:
        """Drop all pending jobs and answer their queries with `reason`."""
        while self._pending:
            self._finish(self._pending[0][0], {"ok": False, "error": reason})

    def _finish(self, query: Query, answer: dict[str, Any]) -> None:
        self._pending.popleft()
        query.reply(answer)
