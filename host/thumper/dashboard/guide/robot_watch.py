"""What the guide follows of the running robot: status, events and the distance driven manually."""

import math
import threading
import time
from collections.abc import Callable
from typing import Protocol

from thumper.common.geometry import Pose2
from thumper.dashboard.display_data import event, stamped_pose
from thumper.ros.codec import Message
from thumper.ros.from_ros import status_of
from thumper.ros.service import QueryClient
from thumper.ros.status import Status

SILENT_S = 1.5
LONGEST_STEP_M = 0.5  # a longer one is a correction of the estimate, not motion


class WatchedBus(QueryClient, Protocol):
    """The part of the bus client that the guide needs."""

    def subscribe(self, topic: str, callback: Callable[[Message], None]) -> None:
        """Call `callback` with each message, on the bus's thread."""
        ...

    def publish(self, topic: str, message: Message) -> None:
        """Send a message."""
        ...


class RobotWatch:
    """The newest messages of the robot. Its callbacks run on the bus's threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._status: Status | None = None
        self._received_s = -math.inf
        self._pose: Pose2 | None = None
        self._manual_m = 0.0
        self._events: list[str] = []

    def connect(self, robot: WatchedBus) -> None:
        """Subscribe to the robot's topics."""
        robot.subscribe("status", self.on_status)
        robot.subscribe("pose", self.on_pose)
        robot.subscribe("events", self.on_event)

    @property
    def status(self) -> Status | None:
        """The newest status; None if the robot is silent."""
        with self._lock:
            return self._status if time.monotonic() - self._received_s < SILENT_S else None

    @property
    def manual_m(self) -> float:
        """Distance driven manually since `restart` [m]."""
        with self._lock:
            return self._manual_m

    def events(self) -> list[str]:
        """Return the texts of the events since `restart`."""
        with self._lock:
            return list(self._events)

    def restart(self) -> None:
        """Forget distance and events."""
        with self._lock:
            self._manual_m = 0.0
            self._events.clear()

    def on_status(self, message: Message) -> None:
        """Store a status."""
        status = status_of(message)
        with self._lock:
            self._status, self._received_s = status, time.monotonic()

    def on_pose(self, message: Message) -> None:
        """Add to the distance while the robot is driven manually."""
        _, pose = stamped_pose(message)
        with self._lock:
            before, self._pose = self._pose, pose
            if before is None or self._status is None or self._status.mode != "manual":
                return
            step_m = math.hypot(pose.x_m - before.x_m, pose.y_m - before.y_m)
            if step_m < LONGEST_STEP_M:
                self._manual_m += step_m

    def on_event(self, message: Message) -> None:
        """Store the text of an event."""
        text = str(event(message)["text"])
        with self._lock:
            self._events.append(text)
