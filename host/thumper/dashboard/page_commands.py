"""From a page's checked orders to the bus, and which pages answer for the robot.

A page that has ordered a motion answers for it: from then on its heartbeats go on to the robot under its
name, and when they end, for whatever reason, the robot stops by itself. A page that only watches may come
and go.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.dashboard.page_messages import (
    CommandMessage,
    EStop,
    ExperimentMessage,
    GoalMessage,
    InitialPose,
    Obstacle,
    PageHeartbeat,
    PageMessage,
    Teleop,
    Waypoints,
)
from thumper.ros.codec import Message
from thumper.ros.to_ros import Messages, flag

Question = Callable[[], str]
"""Asks the robot and returns its answer in words; it waits for that, and raises ThumperError."""


class RobotBus(Protocol):
    """The part of the bus that orders need."""

    def publish(self, topic: str, of: Message, *, source: str) -> None:
        """Send a message to the robot; never waits."""
        ...

    def query(self, name: str, content: Mapping[str, Any], *, source: str) -> Mapping[str, Any]:
        """Ask the robot; raises ThumperError when it refuses or does not answer."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class TeleopLimits:
    """The stick's fastest speeds [m/s, rad/s], and the share of them without turbo."""

    v_m_s: float
    w_rad_s: float
    slow: float = 0.5


class PageCommands:
    """Takes the orders of all pages."""

    def __init__(
        self, robot: RobotBus, limits: TeleopLimits, map_from_base: Callable[[], Pose2 | None]
    ) -> None:
        """`map_from_base` tells where the robot believes it is; None before it is known."""
        self._robot = robot
        self._map_from_base = map_from_base
        self._limits = limits
        self._messages = Messages()
        self._answering: set[str] = set()
        self.newest = ""  # the page that ordered the newest motion; empty: none has

    def leave(self, page: str) -> None:
        """A page is gone; the robot will miss its heartbeats."""
        self._answering.discard(page)

    def obey(self, page: str, order: PageMessage) -> Question | None:
        """Pass an order on to the robot; what must wait for an answer is returned, to be asked elsewhere."""
        now_s = time.time()
        if _moves(order):
            self.newest = page
            self._answering.add(page)
            self._beat(page, now_s)  # before the order: a page that begins must not count as lost
        match order:
            case PageHeartbeat():
                if page in self._answering:
                    self._beat(page, now_s)
            case EStop():
                self._robot.publish("estop", flag(True), source=page)
            case Teleop():
                self._robot.publish("teleop", self._messages.twist(now_s, self._twist(order)), source=page)
            case InitialPose():
                pose = Pose2(x_m=order.x_m, y_m=order.y_m, theta_rad=order.yaw_rad)
                self._robot.publish("initialpose", self._messages.pose(now_s, pose), source=page)
            case Waypoints() if len(order.places) > 1:
                # Each heading is that of the way on from there.
                path = self._messages.path(now_s, np.array(order.places))
                self._robot.publish("waypoints", path, source=page)
            case Waypoints():
                x_m, y_m = order.places[0]
                return self._goal(page, {"x_m": x_m, "y_m": y_m})
            case GoalMessage():
                return self._goal(page, order.model_dump(exclude={"kind"}, exclude_none=True))
            case CommandMessage():
                return lambda: self._answer("command", {"command": order.name}, page)
            case ExperimentMessage():
                content = order.model_dump(exclude={"kind"})
                return lambda: self._answer("experiment/start", content, page)
            case Obstacle():
                return lambda: self._answer("simulator/command", {"pillar": self._pillar(order)}, page)
        return None

    def _pillar(self, order: Obstacle) -> dict[str, float]:
        """The simulated world has a frame of its own: what both know is the robot."""
        map_from_base = self._map_from_base()
        if map_from_base is None:
            raise ThumperError("the robot does not know yet where it is")
        at = map_from_base.inverse() @ Pose2(x_m=order.x_m, y_m=order.y_m)
        return {"x_m": at.x_m, "y_m": at.y_m, "radius_m": order.radius_m}

    def _goal(self, page: str, goal: Mapping[str, float]) -> Question:
        def ask() -> str:
            self._robot.query("mission/send", goal, source=page)
            return ""

        return ask

    def _answer(self, name: str, content: Mapping[str, Any], page: str) -> str:
        return str(self._robot.query(name, content, source=page).get("text", ""))

    def _beat(self, page: str, now_s: float) -> None:
        self._robot.publish("heartbeat", self._messages.header(now_s), source=page)

    def _twist(self, order: Teleop) -> Twist2:
        share = 1.0 if order.turbo else self._limits.slow
        return Twist2(
            v_m_s=share * order.forward * self._limits.v_m_s,
            w_rad_s=share * order.left * self._limits.w_rad_s,
        )


def _moves(order: PageMessage) -> bool:
    if isinstance(order, Teleop):
        return order.forward != 0.0 or order.left != 0.0
    return isinstance(order, GoalMessage | Waypoints | ExperimentMessage)
