"""The page's end of the bus: there before the robot is, and again when the robot comes back."""

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
SILENT_S = 3.0  # a robot at work says something ten times a second


class Client(Protocol):
    """A `BusClient`."""

    def subscribe(self, topic: str, callback: Callable[[Message], None]) -> None:
        """Have each message of a topic."""
        ...

    def publish(self, topic: str, message: Message, *, source: str = "") -> None:
        """Send a message."""
        ...

    def query(self, name: str, payload: Mapping[str, Any], *, source: str = "") -> Mapping[str, Any]:
        """Ask the robot."""
        ...

    def close(self) -> None:
        """Leave the bus."""
        ...


class BusLink:
    """Joins the bus as soon as there is one; until then orders go nowhere and questions are refused."""

    def __init__(self, join: Callable[[], Client]) -> None:
        """`join` opens a client or raises ThumperError, and may wait."""
        self._join = join
        self._client: Client | None = None
        self._end = threading.Event()
        self._heard_s = -math.inf
        self.problem = ""  # why there is no robot, in words

    def start(self, take: Callable[[str, Message], None], topics: tuple[str, ...]) -> None:
        """Begin to join; `take` is called with topic and message, on threads of the bus."""
        threading.Thread(target=self._run, args=(take, topics), name="robot-link", daemon=True).start()

    def publish(self, topic: str, of: Message, *, source: str) -> None:
        """Send a message, if there is a robot."""
        client = self._client  # the thread that joins may take it away at any moment
        if client is not None:
            with suppress(ThumperError):
                client.publish(topic, of, source=source)

    def query(self, name: str, content: Mapping[str, Any], *, source: str = "") -> Mapping[str, Any]:
        """Ask the robot; raises ThumperError when it refuses or does not answer."""
        client = self._client
        if client is None:
            raise ThumperError(self.problem or "there is no robot yet")
        return client.query(name, content, source=source)

    def close(self) -> None:
        """Leave the bus, or stop trying to join."""
        self._end.set()
        self._leave()

    def _run(self, take: Callable[[str, Message], None], topics: tuple[str, ...]) -> None:
        """Join, and join anew when the robot has fallen silent: another one may have taken its place."""

        def heard(topic: str, message: Message) -> None:
            self._heard_s = time.monotonic()
            take(topic, message)

        while not self._end.is_set():
            if self._client is None or time.monotonic() - self._heard_s > SILENT_S:
                self._leave()
                try:
                    # Orders go out from here on: who sees the robot must be able to stop it.
                    self._client = client = self._join()
                    self._heard_s = time.monotonic()
                    for topic in topics:
                        client.subscribe(topic, partial(heard, topic))
                except ThumperError as error:
                    self.problem = str(error)
                    self._leave()
            self._end.wait(RETRY_S)

    def _leave(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()
