"""What the pages show: the newest of each topic, and what has changed since the last tick.

Messages come on the bus's threads, ticks on the server's. Only assignments are made under the lock; a message
is turned into a packet's parts at the tick, once for all pages, and one that a newer has overtaken never is.
"""

import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from thumper.common.geometry import Pose2
from thumper.dashboard import display_data
from thumper.dashboard.binary_packet import Part, encode_packet
from thumper.dashboard.pose_track import PoseTrack
from thumper.ros.codec import Message
from thumper.ros.from_ros import path_of, poses_of

GRIDS = ("map", "local_costmap")
# The status last: who sees the robot has all the rest of it, too.
TOPICS = ("pose", *GRIDS, "scan", "plan", "local_plan", "particles", "wheels", "events", "status")
GRID_PERIOD_S = 0.5  # a grid goes to the pages at most this often
KEPT_WHEEL_ROWS = 600  # a minute at 10 Hz: a page that comes late has charts at once
KEPT_EVENTS = 50


class PageState:
    """The state of one robot as the pages see it."""

    def __init__(self, base_from_laser: Pose2) -> None:
        self._base_from_laser = base_from_laser
        self.on_change: Callable[[], None] = lambda: None  # called at each message, on its thread
        self._lock = threading.Lock()
        self._newest: dict[str, Message] = {}
        self._wheels: deque[Message] = deque(maxlen=KEPT_WHEEL_ROWS)
        self._events: deque[Message] = deque(maxlen=KEPT_EVENTS)
        self._heard_s = -np.inf
        # From here on touched by the ticks alone.
        self._track = PoseTrack()
        self.map_from_base: Pose2 | None = None
        self._values: dict[str, Any] = {}
        self._arrays: dict[str, Part] = {}
        self._rows: deque[display_data.Row] = deque(maxlen=KEPT_WHEEL_ROWS)
        self._lines: deque[dict[str, Any]] = deque(maxlen=KEPT_EVENTS)
        self._grid_sent_s: dict[str, float] = {}
        self._number = 0

    def take(self, topic: str, message: Message) -> None:
        """Note a message of the bus; on any thread."""
        with self._lock:
            self._heard_s = time.monotonic()
            if topic == "wheels":
                self._wheels.append(message)
            elif topic == "events":
                self._events.append(message)
            else:
                self._newest[topic] = message
        self.on_change()

    def value(self, name: str) -> Any:
        """A value as the pages have it; None before it is known."""
        return self._values.get(name)

    def silent_s(self) -> float | None:
        """How long the robot has said nothing [s]; None before its first word."""
        silent_s = time.monotonic() - self._heard_s
        return round(silent_s, 2) if np.isfinite(silent_s) else None

    def tick(self, extra: dict[str, Any]) -> bytes:
        """Return the packet with all that has changed since the last one, and `extra`."""
        with self._lock:
            ready = {name: message for name, message in self._newest.items() if self._is_due(name)}
            for name in ready:
                del self._newest[name]
            wheels, events = list(self._wheels), list(self._events)
            self._wheels.clear()
            self._events.clear()
        values: dict[str, Any] = {}
        arrays: dict[str, Part] = {}
        rows: list[display_data.Row] = []
        lines: list[dict[str, Any]] = []
        for name in TOPICS:  # the pose before the scan that is drawn from it
            if name in ready:
                self._try(self._show, name, ready[name], values, arrays)
        for message in wheels:
            self._try(lambda new: rows.append(display_data.wheel_row(new)), message)
        for message in events:
            self._try(lambda new: lines.append(display_data.event(new)), message)
        if wheels:
            self._try(lambda new: values.update(board=display_data.board(new)), wheels[-1])
        self._values |= values
        self._arrays |= arrays
        self._rows.extend(rows)
        self._lines.extend(lines)
        self._number += 1
        return self._packet(values, arrays, rows, lines, extra)

    def whole(self, extra: dict[str, Any]) -> bytes:
        """Return the packet with all there is, for a page that has just opened or fallen behind."""
        everything = {"whole": True, **extra}
        return self._packet(self._values, self._arrays, list(self._rows), list(self._lines), everything)

    def _show(self, name: str, message: Message, values: dict[str, Any], arrays: dict[str, Part]) -> None:
        if name == "pose":
            time_s, pose = display_data.stamped_pose(message)
            self._track.add(time_s, pose)
            self.map_from_base = pose
            values["pose"] = display_data.triple(pose)
        elif name in GRIDS:
            values[name], arrays[name] = display_data.grid(message)
            self._grid_sent_s[name] = time.monotonic()
        elif name in ("plan", "local_plan"):
            arrays[name] = path_of(message)[:, :2]
        elif name == "particles":
            arrays[name] = poses_of(message)
        elif name == "scan":
            arrays[name] = display_data.scan_points(message, self._base_from_laser, self._track)
        elif name == "status":
            values[name] = display_data.status(message)

    def _try(self, show: Callable[..., None], *what: Any) -> None:
        """A message from elsewhere that makes no sense must not stop the pages."""
        with suppress(ValueError, OverflowError):
            show(*what)

    def _packet(
        self,
        values: dict[str, Any],
        arrays: dict[str, Part],
        rows: list[display_data.Row],
        lines: list[dict[str, Any]],
        extra: dict[str, Any],
    ) -> bytes:
        # Rows stay in the header: their times, seconds of a clock, would be too coarse as float32.
        more = {name: part for name, part in (("wheels", rows), ("events", lines)) if part}
        head = {"t": time.time(), "n": self._number, "silent_s": self.silent_s()}
        return encode_packet({**head, **values, **more, **extra}, arrays)

    def _is_due(self, name: str) -> bool:
        if name not in GRIDS:
            return True
        return time.monotonic() - self._grid_sent_s.get(name, -np.inf) >= GRID_PERIOD_S
