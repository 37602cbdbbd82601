"""The page's connection to the bus: it may start before the robot, and reconnects when the robot returns."""

import math
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any, Protocol

from thumper.common.errors import ThumperError
from thumper.ros.codec import Message

RETRY_S = 1.0
SILENT_S = 3.0  # a running robot publishes ten times per second


class Client(Protocol):
    """The part of `BusClient` that the page needs."""

    def subscribe(self, topic: str, callback: Callable[[Message], None]) -> None:
        """Call `callback` with each message of a topic."""
        ...

    def publish(self, topic: str, message: Message, *, source: str = "") -> None:
        """Send a message."""
        ...

    def query(self, name: str, payload: Mapping[str, Any], *, source: str = "") -> Mapping[str, Any]:
        """Call a service of the robot."""
        ...

    def close(self) -> None:
        """Disconnect."""
        ...


class BusLink:
    """Connects as soon as there is a robot; until then it drops messages and refuses queries."""

    def __init__(self, connect: Callable[[], Client]) -> None:
        """`connect` opens a client or raises ThumperError; it may block."""
        self._connect = connect
        self._client: Client | None = None
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
            if self._client is None or time.monotonic() - self._received_s > SILENT_S:
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
            self._closed.wait(RETRY_S)

    def _disconnect(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()
