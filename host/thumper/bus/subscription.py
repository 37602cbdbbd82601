"""One subscription of a bus client: messages in order, and the newest of a latched topic at once."""

import threading
from collections.abc import Callable

import zenoh

from thumper.ros.topics import TOPICS

QUERY_TIMEOUT_S = 3.0


class Subscription:
    """Passes the messages of one topic to `receive`, one at a time; `key` is the topic's key on the bus."""

    def __init__(self, topic: str, key: str, receive: Callable[[bytes], None], *, latched: bool) -> None:
        """`latched`: also fetch the newest message, if the topic is latched."""
        self._key, self._receive = key, receive
        self._is_latched = latched and TOPICS[topic].latched
        self._lock = threading.RLock()
        self._has_received = False  # since the robot appeared
        self._fetched = b""  # the answer, until the next message has come
        self._subscriber: zenoh.Subscriber[None] | None = None

    def declare(self, session: zenoh.Session) -> None:
        """Subscribe. Zenoh subscribes again if the connection returns. Raises zenoh.ZError."""
        self._subscriber = session.declare_subscriber(self._key, self._on_sample)

    def fetch(self, session: zenoh.Session) -> None:
        """Fetch the newest message of a latched topic, unless one has come. Raises zenoh.ZError."""
        if not self._is_latched or self._has_received:
            return
        for reply in session.get(self._key, timeout=QUERY_TIMEOUT_S):
            with self._lock:
                # The answer may be late, and older than what has come: the newest comes to subscribers, too.
                if reply.ok is not None and not self._has_received:
                    self._has_received = True
                    self._fetched = reply.ok.payload.to_bytes()
                    self._receive(self._fetched)

    def on_robot_lost(self) -> None:
        """Fetch again when the robot returns."""
        with self._lock:
            self._has_received, self._fetched = False, b""

    def _on_sample(self, sample: zenoh.Sample) -> None:
        with self._lock:
            self._has_received = True
            raw, fetched, self._fetched = sample.payload.to_bytes(), self._fetched, b""
            if raw != fetched:  # else sent while it was fetched: it arrived as answer and as message
                self._receive(raw)
