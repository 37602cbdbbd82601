"""What one rosbridge client asks for, operation by operation. No sockets here."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from thumper.bus.client import BusClient
from thumper.bus.request_decoder import QUESTIONS
from thumper.common.errors import ThumperError
from thumper.ros.codec import encode
from thumper.ros.to_json import from_json
from thumper.ros.topics import TOPICS, Direction

LONGEST_THROTTLE_MS = 60_000
QUIET = ("unadvertise", "set_level", "fragment", "png", "auth")  # nothing to be done for these here

Question = Callable[[], dict[str, Any]]
"""Asks the robot, waits for its answer or refusal, and returns what to send."""


@dataclass(slots=True)
class _Subscription:
    period_s: float
    told_s: float = -1e9


class Conversation:
    """One client. `want(topic)` has the topic from the bus; `send(text)` must not wait."""

    def __init__(
        self,
        bus: BusClient,
        want: Callable[[str], str | None],
        send: Callable[[str], None],
        *,
        source: str,
    ) -> None:
        self._bus, self._want, self._send, self._source = bus, want, send, source
        self._subscriptions: dict[str, _Subscription] = {}

    def hear(self, topic: str, text: str) -> None:
        """Pass a message on, if it is wanted now."""
        subscription = self._subscriptions.get(topic)
        now_s = time.monotonic()
        if subscription is not None and now_s - subscription.told_s >= subscription.period_s:
            subscription.told_s = now_s
            self._send(f'{{"op": "publish", "topic": "/{topic}", "msg": {text}}}')

    def take(self, content: Mapping[str, Any]) -> Question | None:
        """Do an operation; returns what takes longer, for another thread, with the answer to send.

        Raises
        ------
        ValueError
            The operation makes no sense; the message says why.
        """
        match content.get("op"):
            case "subscribe":
                self._subscribe(content)
            case "unsubscribe":
                self._subscriptions.pop(_topic(content), None)
            case "advertise":
                self._check_direction(_topic(content), Direction.IN)
                _check_type(_topic(content), content.get("type"))
            case "publish":
                topic = _topic(content)
                self._check_direction(topic, Direction.IN)
                message = from_json(TOPICS[topic].type_name, content.get("msg"))
                self._bus.publish_raw(topic, encode(message), source=self._source)
            case "call_service":
                return lambda: self._call(content)
            case op if op not in QUIET:
                raise ValueError(f"no operation {op!r} here")
        return None

    def _subscribe(self, content: Mapping[str, Any]) -> None:
        topic = _topic(content)
        self._check_direction(topic, Direction.OUT)
        _check_type(topic, content.get("type"))
        throttle_ms = content.get("throttle_rate") or 0
        if not isinstance(throttle_ms, int | float) or not 0 <= throttle_ms <= LONGEST_THROTTLE_MS:
            raise ValueError(f"throttle_rate is 0...{LONGEST_THROTTLE_MS} ms")
        self._subscriptions[topic] = _Subscription(1e-3 * throttle_ms)
        newest = self._want(topic)
        if newest is not None and TOPICS[topic].latched:
            self.hear(topic, newest)

    def _call(self, content: Mapping[str, Any]) -> dict[str, Any]:
        service = str(content.get("service", "")).strip("/")
        arguments = content.get("args") or {}
        answer = {"op": "service_response", "service": f"/{service}", "values": {}, "result": True}
        if isinstance(content.get("id"), str):
            answer["id"] = content["id"]
        try:
            if not isinstance(arguments, dict):
                raise ThumperError("args is an object")
            answer["values"] = self._answer(service, arguments)
        except (ThumperError, ValueError) as error:
            answer |= {"values": str(error), "result": False}
        return answer

    def _answer(self, service: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
        if service in QUESTIONS:
            return self._bus.query(service, arguments, source=self._source)
        types = {f"/{name}": _ros_type(topic.type_name) for name, topic in TOPICS.items()}
        match service:
            case "rosapi/topics":
                return {"topics": list(types), "types": list(types.values())}
            case "rosapi/topic_type":
                return {"type": types.get(f"/{str(arguments.get('topic')).strip('/')}", "")}
            case "rosapi/services":
                return {"services": [f"/{name}" for name in QUESTIONS]}
        raise ThumperError(f"no service /{service}; there are {', '.join(QUESTIONS)}")

    @staticmethod
    def _check_direction(topic: str, direction: Direction) -> None:
        if TOPICS[topic].direction is not direction:
            verb = "is published by the robot" if direction is Direction.IN else "only goes to the robot"
            raise ValueError(f"/{topic} {verb}")


def _topic(content: Mapping[str, Any]) -> str:
    name = content.get("topic")
    if not isinstance(name, str) or name.strip("/") not in TOPICS:
        raise ValueError(f"no topic {name!r}; there are {', '.join(TOPICS)}")
    return name.strip("/")


def _check_type(topic: str, type_name: object) -> None:
    """Both `sensor_msgs/LaserScan` and `sensor_msgs/msg/LaserScan` will do."""
    own = TOPICS[topic].type_name
    if type_name not in (None, "", own, _ros_type(own)):
        raise ValueError(f"/{topic} is {own}, not {type_name!r}")


def _ros_type(type_name: str) -> str:
    package, _, name = type_name.split("/")
    return f"{package}/{name}"
