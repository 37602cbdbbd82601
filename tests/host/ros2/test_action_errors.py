"""A goal that cannot be carried out because of an internal error ends as well."""

import threading
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from benchmarks.shared.live import until

from thumper.ros.codec import Message, message
from thumper.ros.to_json import from_json
from thumper.ros2.actions import ABORTED, RosAction
from thumper.ros2.interfaces import NAVIGATE_TO_POSE, ros_typestore


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_goal_with_an_internal_error_is_aborted() -> None:
    ros_typestore()
    served: dict[str, Any] = {}
    sink = SimpleNamespace(publish=lambda _: None)
    node = SimpleNamespace(
        publisher=lambda *_: sink, serve=lambda name, _type, answer: served.update({name: answer})
    )

    def fail(*_: object) -> tuple[int, Message]:
        raise MemoryError

    RosAction(cast("Any", node), "drive", NAVIGATE_TO_POSE, fail)
    goal_id = message("unique_identifier_msgs/msg/UUID", uuid=np.arange(16, dtype=np.uint8))
    goal = from_json(f"{NAVIGATE_TO_POSE}_Goal", {})
    replies: list[Message] = []
    for part in ("send_goal", "get_result"):
        request = SimpleNamespace(goal_id=goal_id, goal=goal)
        served[f"drive/_action/{part}"](SimpleNamespace(request=request, reply=replies.append))
    until(lambda: len(replies) == 2)
    for thread in threading.enumerate():
        if thread.name == "ros-goal":
            thread.join(5.0)  # its error is reported within this test
    assert replies[0].accepted
    assert replies[1].status == ABORTED
