"""Client of a robot's bus, for the page, the commands, the recorder and your own programs."""

import json
import math
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any

import zenoh

from thumper.bus.zenoh_session import open_client
from thumper.common.closable import Closable
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.ros.codec import Message, decode, encode
from thumper.ros.topics import TOPICS

QUERY_TIMEOUT_S = 3.0
RECONNECT_PERIOD_S = 1.0
SILENCE_S = 3.0  # a running robot publishes ten times per second


class BusClient(Closable):
    """Connects to the bus of one robot. All methods may be called from any thread.

    Raises
    ------
    ThumperError
        No robot runs at the address, or the token is wrong. Every method raises it after `close`.
    """

    def __init__(self, robot: str, address: str, token: str = "") -> None:
        self.robot = robot
        self.source = uuid.uuid4().hex  # the sender's id: heartbeats guard the goals of the same source
        self._prefix = f"thumper/{robot}/"
        self._has_answered = False
        self._session = open_client(address, token)
        self._subscribers: list[zenoh.Subscriber[None]] = []

    def subscribe(self, topic: str, callback: Callable[[Message], None]) -> None:
        """Call `callback` with each decoded message of a topic, and at once with a latched topic's newest.

        `callback` runs in a thread of the bus. Messages that cannot be decoded are dropped.
        """
        type_name = TOPICS[topic].type_name

        def receive(payload: zenoh.ZBytes) -> None:
            try:
                message = decode(payload.to_bytes(), type_name)
            except ValueError:
                return
            callback(message)

        self._subscribe(topic, receive)
        if TOPICS[topic].latched:
            with _readable_errors():
                replies = self._session.get(self._prefix + topic, timeout=QUERY_TIMEOUT_S)
            for reply in replies:
                if reply.ok is not None:
                    receive(reply.ok.payload)

    def subscribe_raw(self, topic: str, callback: Callable[[bytes], None]) -> None:
        """Call `callback` with the CDR of each new message; the newest of a latched topic is not fetched."""
        self._subscribe(topic, lambda payload: callback(payload.to_bytes()))

    def publish(self, topic: str, message: Message, *, source: str = "") -> None:
        """Send a message; pass `source` if one client sends for several."""
        self.publish_raw(topic, encode(message), source=source)

    def publish_raw(self, topic: str, raw: bytes, *, source: str = "") -> None:
        """Send a message that is already encoded as CDR."""
        with _readable_errors():
            self._session.put(
                self._prefix + topic,
                raw,
                attachment=(source or self.source).encode(),
                congestion_control=zenoh.CongestionControl.BLOCK,
                priority=zenoh.Priority.REAL_TIME if topic == "estop" else zenoh.Priority.INTERACTIVE_HIGH,
                express=True,
            )

    def query(
        self, name: str, payload: Mapping[str, Any] | None = None, *, source: str = ""
    ) -> dict[str, Any]:
        """Call a service of the robot and return its answer, in which `ok` is true.

        Raises
        ------
        ThumperError
            The robot refuses the request (the error carries its reason), or does not answer.
        """
        with _readable_errors():
            replies = self._session.get(
                f"{self._prefix}ask/{name}",
                payload=json.dumps(payload or {}),
                attachment=(source or self.source).encode(),
                timeout=QUERY_TIMEOUT_S,
            )
        for reply in replies:
            if reply.ok is not None:
                answer = json.loads(reply.ok.payload.to_bytes())
                if not isinstance(answer, dict):
                    break
                if not answer.get("ok"):
                    raise ThumperError(str(answer.get("error")), option=str(answer.get("option", "")))
                self._has_answered = True
                return answer
        raise self._no_answer()

    def close(self) -> None:
        """Disconnect from the bus."""
        self._session.close()  # type: ignore[no-untyped-call]

    def _subscribe(self, topic: str, receive: Callable[[zenoh.ZBytes], None]) -> None:
        with _readable_errors():
            self._subscribers.append(
                self._session.declare_subscriber(self._prefix + topic, lambda sample: receive(sample.payload))
            )

    def _no_answer(self) -> ThumperError:
        if not self._has_answered:
            return ThumperError(
                f"no robot {self.robot!r} answers on this bus; is that its name?",
                option="--robot",
                exit_code=EXIT_NOT_THERE,
            )
        reason = "no longer answers; it may still be driving: run `thumper stop`"
        if not self._session.info.routers_zid():  # a process that hangs keeps the connection
            reason = "has left the bus: its program has ended, so its wheels stop, or the network is down"
        return ThumperError(f"robot {self.robot!r} {reason}", exit_code=EXIT_NOT_THERE)


class ReconnectingClient:
    """Connects as soon as there is a robot, and again when it returns after a restart.

    Until there is a robot it drops messages and refuses queries.
    """

    def __init__(self, connect: Callable[[], BusClient]) -> None:
        """`connect` opens a client or raises ThumperError; it may block."""
        self._connect = connect
        self._client: BusClient | None = None
        self._closed = threading.Event()
        self._received_s = -math.inf
        self.problem = ""  # why there is no connection

    def start(self, on_message: Callable[[str, Message], None], topics: tuple[str, ...]) -> None:
        """Start connecting; `on_message` is called with topic and message, on threads of the bus."""
        threading.Thread(target=self._run, args=(on_message, topics), name="robot-link", daemon=True).start()

    def publish(self, topic: str, message: Message, *, source: str) -> None:
        """Send a message if there is a robot."""
        client = self._client  # the connecting thread may reset it at any time
        if client is not None:
            with suppress(ThumperError):
                client.publish(topic, message, source=source)

    def query(self, name: str, payload: Mapping[str, Any], *, source: str = "") -> Mapping[str, Any]:
        """Call a service of the robot; raises ThumperError if it refuses or does not answer."""
        client = self._client
        if client is None:
            raise ThumperError(self.problem or "no robot is connected yet")
        return client.query(name, payload, source=source)

    def close(self) -> None:
        """Disconnect, or stop trying to connect."""
        self._closed.set()
        self._disconnect()

    def _run(self, on_message: Callable[[str, Message], None], topics: tuple[str, ...]) -> None:
        """Connect, and reconnect if the robot falls silent: another process may have taken its place."""

        def receive(topic: str, message: Message) -> None:
            self._received_s = time.monotonic()
            on_message(topic, message)

        while not self._closed.is_set():
            if self._client is None or time.monotonic() - self._received_s > SILENCE_S:
                self._disconnect()
                try:
                    # Set before subscribing: whoever sees the robot must be able to stop it.
                    self._client = client = self._connect()
                    self._received_s = time.monotonic()
                    for topic in topics:
                        client.subscribe(topic, partial(receive, topic))
                except ThumperError as error:
                    self.problem = str(error)
                    self._disconnect()
            self._closed.wait(RECONNECT_PERIOD_S)

    def _disconnect(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()


@contextmanager
def _readable_errors() -> Iterator[None]:
    """Re-raise Zenoh's errors as ThumperError; mostly another thread has closed the session."""
    try:
        yield
    except zenoh.ZError as error:
        raise ThumperError(f"the bus fails: {error}") from error
