"""The robot's end of the bus: it sends the robot's messages and queues the requests that come in.

The robot's loop only appends to a bounded queue; one thread encodes and sends. If that thread falls behind,
the oldest messages are dropped and the loop never waits.
"""

import json
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import zenoh

from thumper.bus.request_decoder import RequestDecoder, RequestRefusedError
from thumper.bus.zenoh_session import open_router
from thumper.config.bus import BusOptions
from thumper.ros.codec import Message, encode
from thumper.ros.services import SERVICES
from thumper.ros.topics import PRESENCE, TOPICS, Direction
from thumper.runtime.service.request_queue import RequestQueue

DROPPED_PERIOD_S = 10.0  # between reports of dropped messages
MAX_QUEUED = 256  # about two seconds of all topics


@dataclass(slots=True, kw_only=True)
class BusStatistics:
    """Counts of messages since the start."""

    sent: int = 0
    dropped: int = 0  # the queue was full: the bus is slower than the robot
    failed: int = 0
    refused: int = 0


class BusServer:
    """Serves one robot on the bus; add `publish` to the robot's publisher as a sink.

    Raises
    ------
    ThumperError
        The address is in use.
    """

    def __init__(
        self, robot: str, options: BusOptions, requests: RequestQueue, report: Callable[[str], None]
    ) -> None:
        """`report` logs one line; it is called from other threads and must not block."""
        self.requests = requests  # of the robot that is served now
        self.statistics = BusStatistics()
        self._prefix = f"thumper/{robot}/"
        self._report = report
        self._decoder = RequestDecoder()
        self._reported_s = 0.0
        self._losses_reported = 0
        self._losses_reported_s = -math.inf
        self._queue: deque[Callable[[], None]] = deque()
        self._wake = threading.Condition()
        self._newest: dict[str, Message] = {}  # of latched topics
        self._open = True
        self._session = open_router(robot, options)
        self._publishers = {
            name: self._session.declare_publisher(
                self._prefix + name,
                congestion_control=zenoh.CongestionControl.DROP,
                express=name not in ("map", "map_changes", "local_costmap"),
            )
            for name, topic in TOPICS.items()
            if topic.direction is Direction.OUT
        }
        for name, topic in TOPICS.items():
            if topic.direction is Direction.IN:
                self._session.declare_subscriber(self._prefix + name, self._on_message)
            elif topic.latched:
                self._session.declare_queryable(self._prefix + name, self._reply_newest)
        for name in SERVICES:
            self._session.declare_queryable(f"{self._prefix}ask/{name}", self._on_query)
        # Last: a client that sees the token finds everything else.
        self._presence = self._session.liveliness().declare_token(self._prefix + PRESENCE)
        self._thread = threading.Thread(target=self._run, name="bus", daemon=True)
        self._thread.start()

    def publish(self, topic: str, _stamp_s: float, message: Message) -> None:
        """Queue a message of the robot. Never waits, never raises."""
        self._enqueue(lambda: self._send(topic, message))

    def close(self) -> None:
        """Send what is queued and close the session; a second `close` does nothing."""
        with self._wake:
            if not self._open:
                return
            self._open = False
            self._wake.notify()
        self._thread.join(2.0)
        # Before the session: Zenoh never frees what is undeclared after it.
        for publisher in self._publishers.values():
            publisher.undeclare()  # type: ignore[no-untyped-call]
        self._session.close()  # type: ignore[no-untyped-call]

    def _enqueue(self, job: Callable[[], None]) -> None:
        with self._wake:
            if len(self._queue) >= MAX_QUEUED:
                self._queue.popleft()
                self.statistics.dropped += 1
            self._queue.append(job)
            self._wake.notify()

    def _run(self) -> None:
        while True:
            with self._wake:
                while not self._queue and self._open:
                    self._wake.wait()
                if not self._queue:
                    return
                job = self._queue.popleft()
            try:
                job()
            except Exception:  # a message that cannot be sent must not stop the thread
                self.statistics.failed += 1
            self._report_losses()

    def _report_losses(self) -> None:
        """Report messages that were lost since the last report, at most every 10 s."""
        losses, now_s = self.statistics.dropped + self.statistics.failed, time.monotonic()
        if losses > self._losses_reported and now_s - self._losses_reported_s > DROPPED_PERIOD_S:
            self._report(f"{losses - self._losses_reported} messages did not reach the bus: it is too slow")
            self._losses_reported, self._losses_reported_s = losses, now_s

    def _send(self, topic: str, message: Message) -> None:
        if TOPICS[topic].latched:
            self._newest[topic] = message
        self._publishers[topic].put(encode(message))
        self.statistics.sent += 1

    def _on_message(self, sample: zenoh.Sample) -> None:
        topic = str(sample.key_expr).removeprefix(self._prefix)
        try:
            request = self._decoder.decode_message(
                topic, sample.payload.to_bytes(), _source(sample.attachment), time.monotonic()
            )
        except RequestRefusedError as error:
            self._refuse(error)
        else:
            if request is not None:
                self.requests.put(request)

    def _on_query(self, query: zenoh.Query) -> None:
        name = str(query.key_expr).removeprefix(f"{self._prefix}ask/")
        raw = query.payload.to_bytes() if query.payload else b""

        def reply(answer: Mapping[str, Any]) -> None:
            text = json.dumps(answer)
            self._enqueue(lambda: _reply(query, text))

        try:
            self.requests.put(
                self._decoder.decode_query(name, raw, _source(query.attachment), time.monotonic(), reply)
            )
        except RequestRefusedError as error:
            self._refuse(error)
            reply({"ok": False, "error": str(error)})

    def _reply_newest(self, query: zenoh.Query) -> None:
        message = self._newest.get(str(query.key_expr).removeprefix(self._prefix))
        if message is not None:
            query.reply(query.key_expr, encode(message))
        query.drop()  # type: ignore[no-untyped-call]

    def _refuse(self, error: RequestRefusedError) -> None:
        self.statistics.refused += 1
        if time.monotonic() - self._reported_s > 1.0:  # at most one line per second, even in a flood
            self._reported_s = time.monotonic()
            self._report(f"refused: {error}")


def _reply(query: zenoh.Query, text: str) -> None:
    query.reply(query.key_expr, text)
    query.drop()  # type: ignore[no-untyped-call]


def _source(attachment: zenoh.ZBytes | None) -> str:
    return "" if attachment is None else attachment.to_bytes()[:256].decode(errors="replace")
