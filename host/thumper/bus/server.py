"""The robot's end of the bus: an outlet for what it makes, an inbox for what is asked of it.

The loop only ever appends to a bounded queue; one thread encodes and sends. Whoever does not keep up loses
the oldest messages, and the loop does not notice.
"""

import json
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import zenoh

from thumper.bus.request_decoder import QUESTIONS, Gate, RequestRefusedError
from thumper.bus.zenoh_session import open_listener
from thumper.config.bus import BusOptions
from thumper.ros.codec import Message, encode
from thumper.ros.topics import TOPICS, Direction
from thumper.runtime.service.request_queue import RequestQueue

MOST_QUEUED = 256  # about two seconds of everything


@dataclass(slots=True, kw_only=True)
class BusFigures:
    """What the bus has done since the start."""

    sent: int = 0
    dropped: int = 0  # the queue was full: the bus is slower than the robot
    failed: int = 0
    refused: int = 0


class BusServer:
    """Joins a robot to the bus; hand `publish` to the robot's products as an outlet.

    Raises
    ------
    ThumperError
        The address is taken.
    """

    def __init__(
        self, robot: str, options: BusOptions, inbox: RequestQueue, tell: Callable[[str], None]
    ) -> None:
        """`tell` is given a line for people; it is called from other threads and must not wait."""
        self.figures = BusFigures()
        self._prefix = f"thumper/{robot}/"
        self._inbox = inbox
        self._tell = tell
        self._gate = Gate()
        self._told_s = 0.0
        self._queue: deque[Callable[[], None]] = deque()
        self._wake = threading.Condition()
        self._newest: dict[str, bytes] = {}  # of latched topics
        self._open = True
        self._session = open_listener(options.address, options.token)
        self._publishers = {
            name: self._session.declare_publisher(
                self._prefix + name,
                congestion_control=zenoh.CongestionControl.DROP,
                express=name not in ("map", "local_costmap"),
            )
            for name, topic in TOPICS.items()
            if topic.direction is Direction.OUT
        }
        for name, topic in TOPICS.items():
            if topic.direction is Direction.IN:
                self._session.declare_subscriber(self._prefix + name, self._receive)
            elif topic.latched:
                self._session.declare_queryable(self._prefix + name, self._give_newest)
        for name in QUESTIONS:
            self._session.declare_queryable(f"{self._prefix}ask/{name}", self._ask)
        self._thread = threading.Thread(target=self._work, name="bus", daemon=True)
        self._thread.start()

    def publish(self, topic: str, _stamp_s: float, message: Message) -> None:
        """Queue a product; never waits, never raises."""
        self._enqueue(lambda: self._send(topic, message))

    def close(self) -> None:
        """Send what is queued and leave."""
        with self._wake:
            self._open = False
            self._wake.notify()
        self._thread.join(2.0)
        self._session.close()  # type: ignore[no-untyped-call]

    def _enqueue(self, job: Callable[[], None]) -> None:
        with self._wake:
            if len(self._queue) >= MOST_QUEUED:
                self._queue.popleft()
                self.figures.dropped += 1
            self._queue.append(job)
            self._wake.notify()

    def _work(self) -> None:
        while True:
            with self._wake:
                while not self._queue and self._open:
                    self._wake.wait()
                if not self._queue:
                    return
                job = self._queue.popleft()
            try:
                job()
            except Exception:  # a message that cannot be sent must not end the bus
                self.figures.failed += 1

    def _send(self, topic: str, message: Message) -> None:
        raw = encode(message)
        if TOPICS[topic].latched:
            self._newest[topic] = raw
        self._publishers[topic].put(raw)
        self.figures.sent += 1

    def _receive(self, sample: zenoh.Sample) -> None:
        topic = str(sample.key_expr).removeprefix(self._prefix)
        try:
            request = self._gate.message(
                topic, sample.payload.to_bytes(), _source(sample.attachment), time.monotonic()
            )
        except RequestRefusedError as error:
            self._refuse(error)
        else:
            if request is not None:
                self._inbox.put(request)

    def _ask(self, query: zenoh.Query) -> None:
        name = str(query.key_expr).removeprefix(f"{self._prefix}ask/")
        raw = query.payload.to_bytes() if query.payload else b""

        def reply(answer: Mapping[str, Any]) -> None:
            text = json.dumps(answer)
            self._enqueue(lambda: _reply(query, text))

        try:
            self._inbox.put(
                self._gate.question(name, raw, _source(query.attachment), time.monotonic(), reply)
            )
        except RequestRefusedError as error:
            self._refuse(error)
            reply({"ok": False, "error": str(error)})

    def _give_newest(self, query: zenoh.Query) -> None:
        raw = self._newest.get(str(query.key_expr).removeprefix(self._prefix))
        if raw is not None:
            query.reply(query.key_expr, raw)
        query.drop()  # type: ignore[no-untyped-call]

    def _refuse(self, error: RequestRefusedError) -> None:
        self.figures.refused += 1
        if time.monotonic() - self._told_s > 1.0:  # one line a second tells as much as a thousand
            self._told_s = time.monotonic()
            self._tell(f"refused: {error}")


def _reply(query: zenoh.Query, text: str) -> None:
    query.reply(query.key_expr, text)
    query.drop()  # type: ignore[no-untyped-call]


def _source(attachment: zenoh.ZBytes | None) -> str:
    return "" if attachment is None else attachment.to_bytes()[:256].decode(errors="replace")
