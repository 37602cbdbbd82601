"""Send the pages' checked messages to the robot, and forward the heartbeats of the page that drives it.

The page that starts a motion has control: from then on its heartbeats are forwarded to the robot under its
name. If they end, for whatever reason, the experiment that it started ends; a goal goes on. Another page can
drive only after it has taken control. Every page can stop the robot. Pages that only watch may come and go.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.dashboard.page_messages import (
    AddToMap,
    CommandMessage,
    DeleteFromLibrary,
    EStop,
    ExperimentMessage,
    GoalMessage,
    InitialPose,
    LoadMap,
    Obstacle,
    PageHeartbeat,
    PageMessage,
    Patrol,
    PlaceGoal,
    RemoveFromMap,
    RenameInLibrary,
    SaveMapAs,
    TakeControl,
    Teleop,
    WaypointsMessage,
)
from thumper.maps.annotations import parse_feature
from thumper.ros import services
from thumper.ros.codec import Message
from thumper.ros.service import QueryClient, Service
from thumper.ros.services import (
    LibraryItem,
    NamedMap,
    RemoveAnnotation,
    RenameItem,
    RunCommand,
    SendMission,
    StartExperiment,
)
from thumper.ros.to_ros import Messages, flag

RequestT = TypeVar("RequestT")

PendingQuery = Callable[[], str]
"""Queries the robot, waits for its answer and returns its text; raises ThumperError."""


class RobotBus(QueryClient, Protocol):
    """The part of the bus client that the commands need."""

    def publish(self, topic: str, message: Message, *, source: str) -> None:
        """Send a message to the robot. Never blocks."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class TeleopLimits:
    """Speeds at full stick deflection with turbo [m/s, rad/s]; `slow` is their share without turbo."""

    v_m_s: float
    w_rad_s: float
    slow: float = 0.5


class PageCommands:
    """Handles the messages of all pages."""

    def __init__(
        self, robot: RobotBus, limits: TeleopLimits, map_from_base: Callable[[], Pose2 | None]
    ) -> None:
        """`map_from_base` returns the robot's estimated pose; None before it is known."""
        self._robot = robot
        self._map_from_base = map_from_base
        self._limits = limits
        self._messages = Messages()
        self.on_stop: Callable[[], None] = lambda: None  # also called if a page that could stop has gone
        self.operator = ""  # the page that has control; empty: none

    def on_disconnect(self, page: str) -> None:
        """End the control of a page that has disconnected."""
        self.on_stop()
        if page == self.operator:
            self.operator = ""

    def handle(self, page: str, message: PageMessage) -> PendingQuery | None:
        """Send a message to the robot; return a query, to be run in a thread, if it needs an answer.

        Raises
        ------
        ThumperError
            The message needs control, and another page has it; or the robot's pose is not known.
        """
        now_s = time.time()
        self._update_control(page, message)
        if page == self.operator and (_starts_motion(message) or isinstance(message, PageHeartbeat)):
            self._send_heartbeat(page, now_s)  # before a command: the page must not count as lost
        match message:
            case EStop():
                self.on_stop()
                self._robot.publish("estop", flag(True), source=page)
            case Teleop():
                if message.override:
                    self._robot.publish("override", flag(True), source=page)
                self._robot.publish("teleop", self._messages.twist(now_s, self._twist(message)), source=page)
            case InitialPose():
                pose = Pose2(x_m=message.x_m, y_m=message.y_m, theta_rad=message.yaw_rad)
                self._robot.publish("initialpose", self._messages.pose(now_s, pose), source=page)
            case _:
                return self._query(page, message)
        return None

    def _query(self, page: str, message: PageMessage) -> PendingQuery | None:
        """Return the query that a message needs; raise ThumperError if it is wrong."""
        query: PendingQuery | None = None
        match message:
            case WaypointsMessage():
                goals = [goal.model_dump(exclude_none=True) for goal in message.goals]
                query = self._ask(services.MISSION_FOLLOW, {"goals": goals}, page)
            case GoalMessage():
                goal = SendMission(x_m=message.x_m, y_m=message.y_m, yaw_rad=message.yaw_rad)
                query = self._ask(services.MISSION_SEND, goal, page)
            case PlaceGoal():
                query = self._ask(services.MISSION_SEND, SendMission(place=message.name), page)
            case Patrol():
                goals = [{"place": name} for name in message.places]
                query = self._ask(services.MISSION_FOLLOW, {"goals": goals, "rounds": message.rounds}, page)
            case CommandMessage():
                query = self._ask(services.COMMAND, RunCommand(command=message.name), page)
            case ExperimentMessage():
                experiment = StartExperiment(name=message.name, lane_m=message.lane_m)
                query = self._ask(services.EXPERIMENT_START, experiment, page)
            case Obstacle():
                query = self._ask(services.SIMULATOR_COMMAND, {"pillar": self._pillar(message)}, page)
            case AddToMap():
                parse_feature(message.feature)
                query = self._ask(services.ANNOTATION_ADD, message.feature, page)
            case RemoveFromMap():
                query = self._ask(services.ANNOTATION_REMOVE, RemoveAnnotation(name=message.name), page)
            case _:
                query = self._library_query(page, message)
        return query

    def _library_query(self, page: str, message: PageMessage) -> PendingQuery | None:
        query: PendingQuery | None = None
        match message:
            case SaveMapAs():
                query = self._ask(services.LIBRARY_SAVE, NamedMap(name=message.name), page)
            case LoadMap():
                query = self._ask(services.LIBRARY_LOAD, NamedMap(name=message.name), page)
            case RenameInLibrary():
                item = RenameItem(name=message.name, new_name=message.new_name)
                query = self._ask(services.LIBRARY_RENAME, item, page)
            case DeleteFromLibrary():
                query = self._ask(services.LIBRARY_DELETE, LibraryItem(name=message.name), page)
        return query

    def _ask(self, service: Service[RequestT, Any], request: RequestT, page: str) -> PendingQuery:
        return lambda: getattr(service.call(self._robot, request, source=page), "text", "")

    def _update_control(self, page: str, message: PageMessage) -> None:
        """Give control to a page that takes it or starts a motion; raise ThumperError if another has it."""
        starts_motion = _starts_motion(message)
        if self.operator not in ("", page) and (starts_motion or isinstance(message, InitialPose)):
            raise ThumperError("another page controls the robot; press Take control to drive from here")
        if starts_motion or isinstance(message, TakeControl):
            self.operator = page  # the heartbeats of another page end, and with them its experiment

    def _pillar(self, message: Obstacle) -> dict[str, float]:
        """Return the pillar relative to the robot: the simulated world has its own frame."""
        map_from_base = self._map_from_base()
        if map_from_base is None:
            raise ThumperError("the robot's pose is not known yet")
        pillar = map_from_base.inverse() @ Pose2(x_m=message.x_m, y_m=message.y_m)
        return {"x_m": pillar.x_m, "y_m": pillar.y_m, "radius_m": message.radius_m}

    def _send_heartbeat(self, page: str, now_s: float) -> None:
        self._robot.publish("heartbeat", self._messages.header(now_s), source=page)

    def _twist(self, message: Teleop) -> Twist2:
        share = 1.0 if message.turbo else self._limits.slow
        return Twist2(
            v_m_s=share * message.forward * self._limits.v_m_s,
            w_rad_s=share * message.left * self._limits.w_rad_s,
        )


def _starts_motion(message: PageMessage) -> bool:
    if isinstance(message, Teleop):
        return message.forward != 0.0 or message.left != 0.0
    if isinstance(message, CommandMessage):
        return message.name == "explore"
    return isinstance(message, GoalMessage | WaypointsMessage | PlaceGoal | Patrol | ExperimentMessage)
