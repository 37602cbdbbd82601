"""An action server: goals with feedback, result and cancellation, as rcl_action has them.

An action is three services and two topics below `<name>/_action/`.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from thumper.common.stamps import NS_PER_S
from thumper.ros.codec import Message, encode, message
from thumper.ros.to_json import from_json
from thumper.ros2.interfaces import CANCEL_GOAL
from thumper.ros2.node import RosNode, ServiceCall
from thumper.ros2.wire import TRANSIENT_LOCAL, Qos

EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = 2, 3, 4, 5, 6  # of action_msgs/GoalStatus
UNKNOWN = 0
ACCEPTED_NONE, REJECTED, UNKNOWN_GOAL, TERMINATED = 0, 1, 2, 3  # return codes of CancelGoal
MAX_FINISHED = 32  # goals whose results are remembered
MAX_RUNNING = 8  # goals at a time, each with a thread
NO_ID = bytes(16)


@dataclass(slots=True, eq=False)
class RosGoal:
    """One goal of a client."""

    goal_id: bytes
    content: Message
    accepted_ns: int
    status: int = EXECUTING
    result: Message | None = None
    cancel: threading.Event = field(default_factory=threading.Event)
    waiting: list[ServiceCall] = field(default_factory=list)  # for the result

    @property
    def is_over(self) -> bool:
        """Whether the status is final."""
        return self.status >= SUCCEEDED


Feedback = Callable[[Message], None]
Execute = Callable[[RosGoal, Feedback], tuple[int, Message]]
"""Carries a goal out, in its own thread, until it is over or `cancel` is set; returns status and result."""


class RosAction:
    """Serves one action. Every goal is accepted; `execute` decides what becomes of those before it."""

    def __init__(self, node: RosNode, name: str, type_name: str, execute: Execute) -> None:
        self._type, self._execute = type_name, execute
        self._goals: dict[bytes, RosGoal] = {}
        self._lock = threading.RLock()
        prefix = f"{name}/_action"
        self._feedback = node.publisher(f"{prefix}/feedback", f"{type_name}_FeedbackMessage", Qos())
        self._status = node.publisher(
            f"{prefix}/status",
            "action_msgs/msg/GoalStatusArray",
            Qos(durability=TRANSIENT_LOCAL, depth=1),
        )
        node.serve(f"{prefix}/send_goal", f"{type_name}_SendGoal", self._on_goal)
        node.serve(f"{prefix}/cancel_goal", CANCEL_GOAL, self._on_cancel)
        node.serve(f"{prefix}/get_result", f"{type_name}_GetResult", self._on_result)

    def _on_goal(self, call: ServiceCall) -> None:
        goal_id = call.request.goal_id.uuid.tobytes()
        goal = RosGoal(goal_id=goal_id, content=call.request.goal, accepted_ns=time.time_ns())
        with self._lock:
            running = sum(not one.is_over for one in self._goals.values())
            accepted = goal_id not in self._goals and running < MAX_RUNNING
            if accepted:
                self._goals[goal_id] = goal
        sec, nanosec = divmod(goal.accepted_ns, NS_PER_S)
        stamp = message("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
        call.reply(message(f"{self._type}_SendGoal_Response", accepted=accepted, stamp=stamp))
        if accepted:
            self._publish_status()
            threading.Thread(target=self._run, args=(goal,), name="ros-goal", daemon=True).start()

    def _run(self, goal: RosGoal) -> None:
        def send(feedback: Message) -> None:
            content = message(f"{self._type}_FeedbackMessage", goal_id=_uuid(goal), feedback=feedback)
            self._feedback.publish(encode(content))

        status, result = ABORTED, None
        try:
            status, result = self._execute(goal, send)
        finally:  # also after an internal error: no client may wait forever
            self._finish(goal, status, result)

    def _finish(self, goal: RosGoal, status: int, result: Message | None) -> None:
        with self._lock:
            goal.status, goal.result = status, result
            waiting, goal.waiting = goal.waiting, []
            finished = [one for one in self._goals.values() if one.is_over]
            for old in finished[:-MAX_FINISHED]:
                del self._goals[old.goal_id]
        self._publish_status()
        for call in waiting:
            self._reply_result(call, goal)

    def _on_result(self, call: ServiceCall) -> None:
        with self._lock:
            goal = self._goals.get(call.request.goal_id.uuid.tobytes())
            if goal is not None and not goal.is_over:
                goal.waiting.append(call)
                return
        self._reply_result(call, goal)

    def _reply_result(self, call: ServiceCall, goal: RosGoal | None) -> None:
        status = UNKNOWN if goal is None else goal.status
        result = None if goal is None else goal.result
        if result is None:
            result = from_json(f"{self._type}_Result", {})
        call.reply(message(f"{self._type}_GetResult_Response", status=status, result=result))

    def _on_cancel(self, call: ServiceCall) -> None:
        """Cancel one goal, all, or all up to a time: an id or a stamp of zero means any."""
        wanted = call.request.goal_info
        goal_id = wanted.goal_id.uuid.tobytes()
        until_ns = wanted.stamp.sec * NS_PER_S + wanted.stamp.nanosec
        with self._lock:
            known = self._goals.get(goal_id)
            running = [goal for goal in self._goals.values() if not goal.is_over]
            if goal_id != NO_ID:
                chosen = [goal for goal in running if goal.goal_id == goal_id]
            else:
                chosen = [goal for goal in running if not until_ns or goal.accepted_ns <= until_ns]
            for goal in chosen:
                goal.status = CANCELING
        code = ACCEPTED_NONE if chosen else REJECTED
        if goal_id != NO_ID and not chosen:
            code = UNKNOWN_GOAL if known is None else TERMINATED
        self._publish_status()
        infos = [_info(goal) for goal in chosen]
        call.reply(message(f"{CANCEL_GOAL}_Response", return_code=code, goals_canceling=infos))
        for goal in chosen:
            goal.cancel.set()

    def _publish_status(self) -> None:
        with self._lock:
            entries = [
                message("action_msgs/msg/GoalStatus", goal_info=_info(goal), status=goal.status)
                for goal in self._goals.values()
            ]
            self._status.publish(encode(message("action_msgs/msg/GoalStatusArray", status_list=entries)))


def _uuid(goal: RosGoal) -> Message:
    return message("unique_identifier_msgs/msg/UUID", uuid=np.frombuffer(goal.goal_id, dtype=np.uint8))


def _info(goal: RosGoal) -> Message:
    sec, nanosec = divmod(goal.accepted_ns, NS_PER_S)
    stamp = message("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
    return message("action_msgs/msg/GoalInfo", goal_id=_uuid(goal), stamp=stamp)
