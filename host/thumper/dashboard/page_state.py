"""State of the pages: the newest message of each topic, and what changed since the last tick.

Messages arrive on threads of the bus, ticks run on the server's. The lock guards assignments only. A message
is converted at the tick, once for all pages; a message that a newer one has replaced is never converted.
"""

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from thumper.common.geometry import Pose2
from thumper.dashboard import display_data
from thumper.dashboard.binary_packet import PacketArray, encode_packet
from thumper.dashboard.map_image import MapImage
from thumper.dashboard.pose_history import PoseHistory
from thumper.ros import topics
from thumper.ros.codec import Message
from thumper.ros.from_ros import grid_of, map_change_of, path_of, poses_of

GRIDS = ("map", "local_costmap")
# The status last: a page that shows the robot has all other topics already.
PATHS = ("plan", "local_plan")
SENSORS = ("imu", "gps", "camera")  # of some robots
TOPICS = (
    *("pose", "annotations", "objects", *GRIDS, "scan", *PATHS, "particles"),
    *(*SENSORS, "gps_odom", "wheels", "events", "status"),
)
GRID_PERIOD_S = 0.5  # a grid is sent at most this often
MAX_WHEEL_ROWS = 600  # one minute at 10 Hz, so that a new page has charts at once
MAX_EVENTS = 50
TRAIL_STEP_M = 0.03
MAX_TRAIL_POINTS = 4000  # as the page keeps


class PageState:
    """The state of one robot as shown on the pages."""

    def __init__(self, base_from_laser: Pose2, clock: Callable[[], float] = time.monotonic) -> None:
        self._base_from_laser = base_from_laser
        self._clock = clock
        self.on_change: Callable[[], None] = lambda: None  # called for each message, on its thread
        self._lock = threading.Lock()
        self._newest: dict[str, Message] = {}
        self._wheels: deque[Message] = deque(maxlen=MAX_WHEEL_ROWS)
        self._events: deque[Message] = deque(maxlen=MAX_EVENTS)
        self._map_news: list[Message] = []  # a map or none, then its changes
        self._received_s = -np.inf
        # The attributes below are used only by the ticks.
        self._track = PoseHistory()
        self._map = MapImage()
        self._trail: deque[tuple[float, float]] = deque(maxlen=MAX_TRAIL_POINTS)
        self.map_from_base: Pose2 | None = None
        self._values: dict[str, Any] = {}
        self._arrays: dict[str, PacketArray] = {}
        self._rows: deque[display_data.Row] = deque(maxlen=MAX_WHEEL_ROWS)
        self._lines: deque[dict[str, Any]] = deque(maxlen=MAX_EVENTS)
        self._grid_sent_s: dict[str, float] = {}
        self._sensor_s: dict[str, float] = {}  # when each sensor last sent
        self._sequence = 0

    def on_message(self, topic: str, message: Message) -> None:
        """Store a message of the bus. May be called from any thread."""
        with self._lock:
            self._received_s = self._clock()
            if topic == "wheels":
                self._wheels.append(message)
            elif topic == "events":
                self._events.append(message)
            elif topic == "map":
                self._map_news = [message]
            elif topic == "map_changes":
                self._map_news.append(message)
            else:
                self._newest[topic] = message
        self.on_change()

    def value(self, name: str) -> Any:
        """Return a value as the pages have it; None before it is known."""
        return self._values.get(name)

    def silent_s(self) -> float | None:
        """Return the time since the robot's last message [s]; None before the first."""
        silent_s = self._clock() - self._received_s
        return round(silent_s, 2) if np.isfinite(silent_s) else None

    def tick(self, extra: dict[str, Any]) -> bytes:
        """Return a packet with all changes since the last one, and `extra`."""
        with self._lock:
            due = {name: message for name, message in self._newest.items() if self._is_due(name)}
            for name in due:
                del self._newest[name]
            wheels, events = list(self._wheels), list(self._events)
            map_news = self._map_news if self._is_due("map") else []
            self._map_news = self._map_news[len(map_news) :]
            self._wheels.clear()
            self._events.clear()
        values: dict[str, Any] = {}
        arrays: dict[str, PacketArray] = {}
        rows: list[display_data.Row] = []
        lines: list[dict[str, Any]] = []
        for name in TOPICS:  # the pose before the scan, which uses it
            if name in due:
                self._try(self._convert, name, due[name], values, arrays)
        for message in map_news:
            self._try(self._take_map, message)
        if map_news and (part := self._map.part()):
            self._grid_sent_s["map"] = self._clock()
            values["map"], arrays["map"] = part
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
        self._sequence += 1
        return self._packet(values, arrays, rows, lines, extra)

    def full_packet(self, extra: dict[str, Any]) -> bytes:
        """Return a packet with everything, for a new page or one that has fallen behind."""
        values, arrays = dict(self._values), dict(self._arrays)
        if whole := self._map.whole():
            values["map"], arrays["map"] = whole
        trail_m = [round(part, 3) for point in self._trail for part in point]
        everything = {"whole": True, "trail": trail_m, **extra}
        return self._packet(values, arrays, list(self._rows), list(self._lines), everything)

    def _take_map(self, message: Message) -> None:
        if message.__msgtype__ == topics.TOPICS["map"].type_name:
            self._map.replace(grid_of(message))
        else:
            self._map.change(*map_change_of(message))

    def _take_pose(self, message: Message) -> Pose2:
        time_s, pose = display_data.stamped_pose(message)
        self._track.add(time_s, pose)
        self.map_from_base = pose
        here_m = pose.x_m, pose.y_m
        if self._values.get("status", {}).get("pose_lost"):
            return pose  # the robot has not driven from one guess to the next
        if not self._trail or math.dist(here_m, self._trail[-1]) > TRAIL_STEP_M:
            self._trail.append(here_m)
        return pose

    def _convert(
        self, name: str, message: Message, values: dict[str, Any], arrays: dict[str, PacketArray]
    ) -> None:
        if name == "pose":
            values["pose"] = display_data.pose_list(self._take_pose(message))
        elif name == "local_costmap":
            values[name], arrays[name] = display_data.grid_data(message)
            self._grid_sent_s[name] = self._clock()
        elif name in SENSORS:
            self._convert_sensor(name, message, values, arrays)
        elif name == "gps_odom":
            values[name] = display_data.gps_in_map(message)
        elif name == "annotations":
            values[name] = display_data.annotations(message)
        elif name == "objects":
            values[name] = display_data.objects(message)
        elif name in PATHS:
            arrays[name] = path_of(message)[:, :2]
        elif name == "particles":
            arrays[name] = poses_of(message)
        elif name == "scan":
            arrays[name] = display_data.scan_points(message, self._base_from_laser, self._track)
        elif name == "status":
            values[name] = display_data.status(message)
            if values[name]["lidar_scans"] < self._values.get("status", values[name])["lidar_scans"]:
                self._trail.clear()
                self._sensor_s.clear()  # the robot restarted, perhaps without them
                values.setdefault("objects", [])

    def _convert_sensor(
        self, name: str, message: Message, values: dict[str, Any], arrays: dict[str, PacketArray]
    ) -> None:
        if name == "camera":
            values[name], arrays[name] = display_data.camera(message)
        else:
            values[name] = display_data.imu(message) if name == "imu" else display_data.gps(message)
        self._sensor_s[name] = self._clock()

    def _try(self, convert: Callable[..., None], *arguments: Any) -> None:
        """Convert a message and skip it if it is invalid: it must not stop the pages."""
        with suppress(ValueError, OverflowError):
            convert(*arguments)

    def _packet(
        self,
        values: dict[str, Any],
        arrays: dict[str, PacketArray],
        rows: list[display_data.Row],
        lines: list[dict[str, Any]],
        extra: dict[str, Any],
    ) -> bytes:
        # Rows stay in the header: float32 is too coarse for their time stamps.
        tables = {name: table for name, table in (("wheels", rows), ("events", lines)) if table}
        ages_s = {name: round(self._clock() - at_s, 1) for name, at_s in self._sensor_s.items()}
        head = {"t": time.time(), "n": self._sequence, "silent_s": self.silent_s(), "sensor_age_s": ages_s}
        return encode_packet({**head, **values, **tables, **extra}, arrays)

    def _is_due(self, name: str) -> bool:
        if name not in GRIDS:
            return True
        return self._clock() - self._grid_sent_s.get(name, -np.inf) >= GRID_PERIOD_S
