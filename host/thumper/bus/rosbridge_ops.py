"""Handle the operations of one rosbridge client. No sockets here."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from thumper.bus.client import BusClient
from thumper.common.errors import ThumperError
from thumper.common.texts import shortened
from thumper.ros.codec import encode
from thumper.ros.services import SERVICES
from thumper.ros.to_json import from_json
from thumper.ros.topics import TOPICS, Direction

MAX_THROTTLE_MS = 60_000
IGNORED_OPS = ("unadvertise", "set_level", "fragment", "png", "auth")  # accepted, without effect here

PendingQuery = Callable[[], dict[str, Any]]
"""Queries the robot, waits for its answer or refusal, and returns the message to send."""


@dataclass(slots=True)
class _Subscription:
    period_s: float
    sent_s: float = -1e9


class RosbridgeClient:
    """One client. `request_topic(topic)` subscribes to the bus; `send(text)` must not block."""

    def __init__(
        self,
        bus: BusClient,
        request_topic: Callable[[str], str | None],
        send: Callable[[str], None],
        *,
        source: str,
    ) -> None:
        self._bus, self._request_topic, self._send, self._source = bus, request_topic, send, source
        self._subscriptions: dict[str, _Subscription] = {}

    def on_message(self, topic: str, text: str) -> None:
        """Send a message to the client, if it has subscribed and its throttle allows it."""
        subscription = self._subscriptions.get(topic)
        now_s = time.monotonic()
        if subscription is not None and now_s - subscription.sent_s >= subscription.period_s:
            subscription.sent_s = now_s
            self._send(f'{{"op": "publish", "topic": "/{topic}", "msg": {text}}}')

    def handle(self, content: Mapping[str, Any]) -> PendingQuery | None:
        """Do an operation; return a query if it needs one, to be run in another thread.

        Raises
        ------
        ValueError
            The operation is invalid; the text gives the reason.
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
            case op if op not in IGNORED_OPS:
                raise ValueError(f"operation {op!r} is not supported")
        return None

    def _subscribe(self, content: Mapping[str, Any]) -> None:
        topic = _topic(content)
        self._check_direction(topic, Direction.OUT)
        _check_type(topic, content.get("type"))
        throttle_ms = content.get("throttle_rate") or 0
        if not isinstance(throttle_ms, int | float) or not 0 <= throttle_ms <= MAX_THROTTLE_MS:
            raise ValueError(f"throttle_rate must be 0 to {MAX_THROTTLE_MS} ms")
        self._subscriptions[topic] = _Subscription(1e-3 * throttle_ms)
        newest = self._request_topic(topic)
        if newest is not None and TOPICS[topic].latched:
            self.on_message(topic, newest)

    def _call(self, content: Mapping[str, Any]) -> dict[str, Any]:
        service = str(content.get("service", "")).strip("/")
        arguments = content.get("args") or {}
        answer = {"op": "service_response", "service": shortened(f"/{service}"), "values": {}, "result": True}
        if isinstance(content.get("id"), str):
            answer["id"] = content["id"]
        try:
            if not isinstance(arguments, dict):
                raise ThumperError("args must be an object")
            answer["values"] = self._answer(service, arguments)
        except (ThumperError, ValueError) as error:
            answer |= {"values": shortened(str(error)), "result": False}
        return answer

    def _answer(self, service: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
        if service in SERVICES:
            return self._bus.query(service, arguments, source=self._source)
        types = {f"/{name}": _ros_type(topic.type_name) for name, topic in TOPICS.items()}
        match service:
            case "rosapi/topics":
                return {"topics": list(types), "types": list(types.values())}
            case "rosapi/topic_type":
                return {"type": types.get(f"/{str(arguments.get('topic')).strip('/')}", "")}
            case "rosapi/services":
                return {"services": [f"/{name}" for name in SERVICES]}
        raise ThumperError(f"no service /{service}; choose from: {', '.join(SERVICES)}")

    @staticmethod
    def _check_direction(topic: str, direction: Direction) -> None:
        if TOPICS[topic].direction is not direction:
            reason = "is published by the robot" if direction is Direction.IN else "is only sent to the robot"
            raise ValueError(f"/{topic} {reason}")


def _topic(content: Mapping[str, Any]) -> str:
    name = content.get("topic")
    if not isinstance(name, str) or name.strip("/") not in TOPICS:
        raise ValueError(f"no topic {name!r}; choose from: {', '.join(TOPICS)}")
    return name.strip("/")


def _check_type(topic: str, type_name: object) -> None:
    """Refuse another type; accept both `sensor_msgs/LaserScan` and `sensor_msgs/msg/LaserScan`."""
    expected = TOPICS[topic].type_name
    if type_name not in (None, "", expected, _ros_type(expected)):
        raise ValueError(f"/{topic} is {expected}, not {type_name!r}")


def _ros_type(type_name: str) -> str:
    package, _, name = type_name.split("/")
    return f"{package}/{name}"
