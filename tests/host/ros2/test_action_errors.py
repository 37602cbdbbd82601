"""Goals that fail inside, are too many, or whose cancellation the robot refuses."""

import threading
import time
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from benchmarks.shared.live import until

from thumper.common.errors import ThumperError
from thumper.ros import services
from thumper.ros.codec import Message, message
from thumper.ros.to_json import from_json
from thumper.ros2 import navigation
from thumper.ros2.actions import ABORTED, MAX_RUNNING, SUCCEEDED, RosAction, RosGoal
from thumper.ros2.interfaces import NAVIGATE_TO_POSE, ros_typestore


class Action:
    """An action server on a node without a network."""

    def __init__(self, execute: Any) -> None:
        ros_typestore()
        self.served: dict[str, Any] = {}
        sink = SimpleNamespace(publish=lambda _: None)
        node = SimpleNamespace(
            publisher=lambda *_: sink, serve=lambda name, _type, answer: self.served.update({name: answer})
        )
        RosAction(cast("Any", node), "drive", NAVIGATE_TO_POSE, execute)

    def call(self, part: str, number: int, replies: list[Message]) -> None:
        """Send a request about goal `number`."""
        uuid = np.full(16, number, dtype=np.uint8)
        goal_id = message("unique_identifier_msgs/msg/UUID", uuid=uuid)
        request = SimpleNamespace(goal_id=goal_id, goal=from_json(f"{NAVIGATE_TO_POSE}_Goal", {}))
        self.served[f"drive/_action/{part}"](SimpleNamespace(request=request, reply=replies.append))


def join_goals() -> None:
    """Wait for the threads of all goals: their errors are reported within this test."""
    for thread in threading.enumerate():
        if thread.name == "ros-goal":
            thread.join(5.0)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_goal_with_an_internal_error_is_aborted() -> None:
    def fail(*_: object) -> tuple[int, Message]:
        raise MemoryError

    action, replies = Action(fail), list[Message]()
    for part in ("send_goal", "get_result"):
        action.call(part, 1, replies)
    until(lambda: len(replies) == 2)
    join_goals()
    assert replies[0].accepted
    assert replies[1].status == ABORTED


def test_only_so_many_goals_run_at_a_time() -> None:
    """A client that sends goals without end starts no threads without end; later there is room again."""
    ready = threading.Event()

    def wait(*_: object) -> tuple[int, Message]:
        ready.wait(10.0)
        return SUCCEEDED, from_json(f"{NAVIGATE_TO_POSE}_Result", {})

    action, replies = Action(wait), list[Message]()
    for number in range(MAX_RUNNING + 3):
        action.call("send_goal", number, replies)
    assert [reply.accepted for reply in replies] == [True] * MAX_RUNNING + [False] * 3
    assert sum(thread.name == "ros-goal" for thread in threading.enumerate()) == MAX_RUNNING
    ready.set()
    join_goals()
    action.call("send_goal", 100, replies)
    assert replies[-1].accepted
    join_goals()


def test_goal_goes_on_while_the_robot_refuses_to_cancel(monkeypatch: pytest.MonkeyPatch) -> None:
    """Longer than a lost robot is given: the robot answers, and drives."""
    asked: list[float] = []
    monkeypatch.setattr(navigation, "LOST_S", 0.3)
    monkeypatch.setattr(navigation, "PERIOD_S", 0.05)

    def state(*_: object) -> SimpleNamespace:
        driving = len(asked) < 12 or time.monotonic() - asked[0] < 0.6
        return SimpleNamespace(state="driving" if driving else "reached", leg=0, reason="at the goal")

    def refuse(*_: object) -> None:
        asked.append(time.monotonic())
        raise ThumperError("refused")

    monkeypatch.setattr(services, "MISSION_STATE", SimpleNamespace(call=state))
    monkeypatch.setattr(services, "COMMAND", SimpleNamespace(call=refuse))
    actions = object.__new__(navigation.NavigationActions)
    actions._bus = cast("Any", None)
    goal = RosGoal(goal_id=bytes(16), content=cast("Any", None), accepted_ns=0)
    goal.cancel.set()
    outcome = actions._drive(goal, lambda: cast("Any", SimpleNamespace(mission=1)), lambda _: None)
    assert outcome.status == SUCCEEDED
    assert len(asked) >= 12
