"""A running robot in simulation, which gets its requests through the queue; telemetry shows their effect.

Simulated time advances with each cycle. So does the monotonic clock, which times manual commands and
heartbeats.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from thumper.board.messages import Telemetry
from thumper.common.geometry import Pose2
from thumper.navigation.goal import Goal
from thumper.ros.codec import Message
from thumper.ros.services import SERVICES
from thumper.runtime.loop import RobotLoop
from thumper.runtime.requests import Query, Request
from thumper_hil.bench import Bench

START = Pose2(x_m=1.73, y_m=0.08, theta_rad=math.pi)
NEAR, FAR = Goal(x_m=1.2, y_m=0.05), Goal(x_m=0.0, y_m=0.05)
MANUAL_TIMEOUT_S = 0.3


class Service:
    """A robot and its control cycles."""

    def __init__(self, robot: RobotLoop, bench: Bench) -> None:
        self.robot, self.bench = robot, bench
        self.waited_s = 0.0
        self.events: list[str] = []
        self.status: Message | None = None
        robot.publisher.add_sink(self._listen)
        robot.request_handler.accepts_goals = True

    def wall_s(self) -> float:
        """Return the monotonic clock: simulated time, plus what the test has waited between cycles."""
        return self.bench.time_s + self.waited_s

    def _listen(self, topic: str, _stamp_s: float, message: Message) -> None:
        if topic == "events":
            self.events.append(message.msg)
        elif topic == "status":
            self.status = message

    def run_cycles(self, count: int) -> None:
        for _ in range(count):
            self.robot.cycle()

    def put(self, *requests: Request) -> None:
        for request in requests:
            self.robot.request_queue.put(request)
        self.run_cycles(1)

    def until(self, condition: Callable[[], bool], max_cycles: int = 300) -> None:
        for _ in range(max_cycles):
            if condition():
                return
            self.run_cycles(1)
        raise AssertionError(self.robot.drive_manager.reason)

    def ask(self, name: str, content: Mapping[str, Any] | None = None) -> dict[str, Any]:
        answers: list[Mapping[str, Any]] = []
        self.put(Query(name=name, content=content or {}, reply=answers.append))
        self.until(lambda: bool(answers), max_cycles=10)  # board jobs share the cycles with the drive
        (answer,) = answers
        if answer["ok"]:  # every reply has exactly the fields of its type
            reply = SERVICES[name].read_reply(answer)
            assert set(answer) - {"ok"} == {field.name for field in fields(reply)}
        return dict(answer)

    @property
    def telemetry(self) -> Telemetry:
        telemetry = self.robot.inputs.telemetry
        assert telemetry is not None
        return telemetry

    @property
    def mode(self) -> str:
        return self.robot.drive_manager.mode.value
