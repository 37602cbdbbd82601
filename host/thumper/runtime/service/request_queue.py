"""Queue of requests for the robot's loop. Any thread may add requests; adding never blocks."""

import threading
import time
from collections import deque

from thumper.common.geometry import Twist2
from thumper.runtime.requests import EmergencyStop, Request, RobotCommand, Velocity

MAX_PENDING = 256  # each cycle empties the queue; a flood beyond this drops the oldest requests


class RequestQueue:
    """Bounded queue. A flood of requests cannot displace an emergency stop."""

    def __init__(self) -> None:
        self._pending: deque[tuple[float, Request]] = deque(maxlen=MAX_PENDING)
        self._emergency_stop = threading.Event()

    def put(self, request: Request) -> None:
        """Add a request, from any thread."""
        if isinstance(request, EmergencyStop):
            self._emergency_stop.set()
        else:
            self._pending.append((time.monotonic(), request))

    @property
    def is_urgent(self) -> bool:
        """Whether a request waits that stops or moves the robot at once."""
        return self._emergency_stop.is_set() or any(
            isinstance(request, RobotCommand) or (isinstance(request, Velocity) and request.twist != Twist2())
            for _, request in self._pending.copy()
        )

    def take_all(self) -> list[tuple[float, Request]]:
        """Remove and return all requests with arrival times [s, monotonic]: stops first, then oldest."""
        taken: list[tuple[float, Request]] = []
        if self._emergency_stop.is_set():
            self._emergency_stop.clear()
            taken.append((time.monotonic(), EmergencyStop()))
        for _ in range(len(self._pending)):
            taken.append(self._pending.popleft())
        return taken
