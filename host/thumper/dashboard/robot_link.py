"""The page's end of the bus: there before the robot is, and again when the robot comes back."""

import threading
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Protocol

from thumper.errors import ThumperError
from thumper.ros.codec import Message

RETRY_S = 1.0


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


class RobotLink:
    """Joins the bus as soon as there is one; until then orders go nowhere and questions are refused."""

    def __init__(self, join: Callable[[], Client]) -> None:
        """`join` opens a client or raises ThumperError, and may wait."""
        self._join = join
        self._client: Client | None = None
        self._end = threading.Event()
        self.problem = ""  # why there is no robot, in words

    def start(self, take: Callable[[str, Message], None], topics: tuple[str, ...]) -> None:
        """Begin to join; `take` is called with topic and message, on threads of the bus."""
        threading.Thread(target=self._run, args=(take, topics), name="robot-link", daemon=True).start()

    def publish(self, topic: str, of: Message, *, source: str) -> None:
        """Send a message, if there is a robot."""
        if self._client is not None:
            self._client.publish(topic, of, source=source)

    def query(self, name: str, content: Mapping[str, Any], *, source: str = "") -> Mapping[str, Any]:
        """Ask the robot; raises ThumperError when it refuses or does not answer."""
        if self._client is None:
            raise ThumperError(self.problem or "there is no robot yet")
        return self._client.query(name, content, source=source)

    def close(self) -> None:
        """Leave the bus, or stop trying to join."""
        self._end.set()
        if self._client is not None:
            self._client.close()

    def _run(self, take: Callable[[str, Message], None], topics: tuple[str, ...]) -> None:
        while not self._end.is_set():
            try:
                client = self._join()
            except ThumperError as error:
                self.problem = str(error)
                self._end.wait(RETRY_S)
                continue
            self._client = client
            for topic in topics:
                client.subscribe(topic, partial(take, topic))
            return
