"""Where requests wait for the robot's loop; any thread may put them in, and none ever waits."""

import threading
import time
from collections import deque

from thumper.runtime.requests import EmergencyStop, Request

MAX_PENDING = 256  # a beat takes them all; more than this is a flood, and its oldest part is dropped


class RequestQueue:
    """Bounded; an emergency stop cannot be crowded out."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[float, Request]] = deque(maxlen=MAX_PENDING)
        self._stop = threading.Event()

    def put(self, request: Request) -> None:
        """Leave a request, from any thread."""
        if isinstance(request, EmergencyStop):
            self._stop.set()
        else:
            self._waiting.append((time.monotonic(), request))

    def take(self) -> list[tuple[float, Request]]:
        """Return what came since, oldest first, with the times it came [s, monotonic]; stops go first."""
        taken: list[tuple[float, Request]] = []
        if self._stop.is_set():
            self._stop.clear()
            taken.append((time.monotonic(), EmergencyStop()))
        for _ in range(len(self._waiting)):
            taken.append(self._waiting.popleft())
        return taken
