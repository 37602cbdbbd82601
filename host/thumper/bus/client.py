"""The other end of the bus: for the page, the commands, the recorder and your own programs."""

import json
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import zenoh

from thumper.bus.zenoh_session import open_joiner
from thumper.common.closable import Closable
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.ros.codec import Message, decode, encode
from thumper.ros.topics import TOPICS

QUERY_TIMEOUT_S = 3.0


class BusClient(Closable):
    """Joins the bus of one robot; any thread may use it, or close it.

    Raises
    ------
    ThumperError
        No robot runs there, or the token is not its own; later, from every method: it has been closed.
    """

    def __init__(self, robot: str, address: str, token: str = "") -> None:
        self.robot = robot
        self.source = uuid.uuid4().hex  # who sends; heartbeats and goals of one client belong together
        self._prefix = f"thumper/{robot}/"
        self._has_answered = False
        self._session = open_joiner(address, token)
        self._subscribers: list[zenoh.Subscriber[None]] = []

    def subscribe(self, topic: str, callback: Callable[[Message], None]) -> None:
        """Have each message of a topic, decoded; of a latched one the newest at once.

        `callback` runs in a thread of the bus. A message that is none is dropped.
        """
        type_name = TOPICS[topic].type_name

        def take(payload: zenoh.ZBytes) -> None:
            try:
                message = decode(payload.to_bytes(), type_name)
            except ValueError:
                return
            callback(message)

        self._subscribe(topic, take)
        if TOPICS[topic].latched:
            with _explained():
                replies = self._session.get(self._prefix + topic, timeout=QUERY_TIMEOUT_S)
            for reply in replies:
                if reply.ok is not None:
                    take(reply.ok.payload)

    def subscribe_raw(self, topic: str, callback: Callable[[bytes], None]) -> None:
        """Have each message of a topic as it comes over the wire (CDR), not the newest of a latched one."""
        self._subscribe(topic, lambda payload: callback(payload.to_bytes()))

    def publish(self, topic: str, message: Message, *, source: str = "") -> None:
        """Send a message; `source` names who sends when one client speaks for several."""
        self.publish_raw(topic, encode(message), source=source)

    def publish_raw(self, topic: str, raw: bytes, *, source: str = "") -> None:
        """Send a message that is CDR already."""
        with _explained():
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
        """Ask the robot something and return its answer, in which `ok` is true.

        Raises
        ------
        ThumperError
            The robot refuses, in its words; or it does not answer.
        """
        with _explained():
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
        if self._has_answered:
            why = "does not answer any more; what it was doing it may still do: `thumper stop`"
            if not self._session.info.routers_zid():  # whoever hangs keeps the connection
                why = "has left the bus: its program has ended, so its wheels stop, or the network is gone"
            raise ThumperError(f"robot {self.robot!r} {why}", exit_code=EXIT_NOT_THERE)
        raise ThumperError(
            f"no robot {self.robot!r} answers on this bus; is that its name?",
            option="--robot",
            exit_code=EXIT_NOT_THERE,
        )

    def close(self) -> None:
        """Leave the bus."""
        self._session.close()  # type: ignore[no-untyped-call]

    def _subscribe(self, topic: str, take: Callable[[zenoh.ZBytes], None]) -> None:
        with _explained():
            self._subscribers.append(
                self._session.declare_subscriber(self._prefix + topic, lambda sample: take(sample.payload))
            )


@contextmanager
def _explained() -> Iterator[None]:
    """Tell a bus that fails in words: mostly, it was left on another thread."""
    try:
        yield
    except zenoh.ZError as error:
        raise ThumperError(f"the bus fails: {error}") from error
