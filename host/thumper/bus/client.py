"""Client of a robot's bus, for the page, the commands, the recorder and your own programs."""

import json
import threading
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

import zenoh

from thumper.bus.subscription import QUERY_TIMEOUT_S, Subscription
from thumper.bus.zenoh_session import open_client
from thumper.common.closable import Closable
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.ros.codec import Message, decode, encode
from thumper.ros.topics import PRESENCE, TOPICS

RECONNECT_PERIOD_S = 1.0


class BusClient(Closable):
    """Connects to the bus of one robot, and again when the robot returns after a restart.

    All methods may be called from any thread. Without a robot, messages are dropped and queries raise.

    Raises
    ------
    ThumperError
        No robot runs at the address, or the token is wrong. Every method raises it after `close`.
    """

    def __init__(
        self, robot: str, address: str, token: str = "", *, tls: str = "", wait: bool = False
    ) -> None:
        """`tls` is as in `[bus]`; `wait`: connect in the background as soon as there is a robot."""
        self.robot = robot
        self.source = uuid.uuid4().hex  # the sender's id: an experiment needs the heartbeats of its source
        self._prefix = f"thumper/{robot}/"
        self._has_answered = False
        self._problem = "no robot is connected yet"
        self._lock = threading.Lock()
        self._subscriptions: list[Subscription] = []
        self._on_lost: list[Callable[[], None]] = []
        self._session: zenoh.Session | None = None
        self._presence: zenoh.Subscriber[None] | None = None
        self._closed = threading.Event()
        if wait:
            threading.Thread(
                target=self._connect, args=(address, token, tls), name="bus-connect", daemon=True
            ).start()
        else:
            self._start(open_client(address, token, tls))

    def subscribe(self, topic: str, callback: Callable[[Message], None]) -> None:
        """Call `callback` with each decoded message of a topic, and at once with a latched topic's newest.

        `callback` runs in a thread of the bus. Messages that cannot be decoded are dropped.
        """
        type_name = TOPICS[topic].type_name

        def receive(raw: bytes) -> None:
            try:
                message = decode(raw, type_name)
            except ValueError:
                return
            callback(message)

        self._subscribe(Subscription(topic, self._prefix + topic, receive, latched=True))

    def subscribe_raw(self, topic: str, callback: Callable[[bytes], None], *, latched: bool = False) -> None:
        """Call `callback` with the CDR of each new message; `latched`: and with a latched topic's newest."""
        self._subscribe(Subscription(topic, self._prefix + topic, callback, latched=latched))

    def newest(self, topic: str) -> Message | None:
        """Return the newest message of a latched topic; None if the robot has none or does not answer."""
        if self._session is None:
            return None
        with _readable_errors():
            for reply in self._session.get(self._prefix + topic, timeout=QUERY_TIMEOUT_S):
                if reply.ok is not None:
                    with suppress(ValueError):
                        return decode(reply.ok.payload.to_bytes(), TOPICS[topic].type_name)
        return None

    def on_lost(self, callback: Callable[[], None]) -> None:
        """Call `callback`, in a thread of the bus, each time the robot has left the bus."""
        self._on_lost.append(callback)

    def publish(self, topic: str, message: Message, *, source: str = "") -> None:
        """Send a message; pass `source` if one client sends for several."""
        self.publish_raw(topic, encode(message), source=source)

    def publish_raw(self, topic: str, raw: bytes, *, source: str = "") -> None:
        """Send a message that is already encoded as CDR."""
        if self._session is None:
            return
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
        session = self._session
        if session is None:
            raise ThumperError(self._problem, exit_code=EXIT_NOT_THERE)
        with _readable_errors():
            replies = session.get(
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
        raise self._no_answer(session)

    def close(self) -> None:
        """Disconnect from the bus, or stop trying to connect."""
        with self._lock:
            self._closed.set()
            session = self._session
        if session is not None:
            session.close()  # type: ignore[no-untyped-call]

    def _connect(self, address: str, token: str, tls: str) -> None:
        while not self._closed.is_set():
            try:
                self._start(open_client(address, token, tls))
            except ThumperError as error:
                self._problem = str(error)
                self._closed.wait(RECONNECT_PERIOD_S)
            else:
                return

    def _start(self, session: zenoh.Session) -> None:
        """Use the session. From here on Zenoh connects again by itself."""
        with self._lock:
            if self._closed.is_set():
                session.close()  # type: ignore[no-untyped-call]
                return
            self._session = session  # before subscribing: whoever sees the robot must be able to stop it
            subscriptions = tuple(self._subscriptions)
        with _readable_errors():
            for subscription in subscriptions:
                subscription.declare(session)
            self._presence = session.liveliness().declare_subscriber(
                self._prefix + PRESENCE, self._on_presence, history=True
            )

    def _on_presence(self, sample: zenoh.Sample) -> None:
        """The robot has appeared on the bus or left it."""
        with self._lock:
            session, subscriptions = self._session, tuple(self._subscriptions)
        if sample.kind == zenoh.SampleKind.DELETE:
            for subscription in subscriptions:
                subscription.on_robot_lost()
            for callback in tuple(self._on_lost):
                callback()
            return
        with suppress(zenoh.ZError):  # closed meanwhile
            for subscription in subscriptions:
                if session is not None:
                    subscription.fetch(session)

    def _subscribe(self, subscription: Subscription) -> None:
        with self._lock:
            self._subscriptions.append(subscription)
            session = self._session
        if session is not None:
            with _readable_errors():
                subscription.declare(session)
                subscription.fetch(session)

    def _no_answer(self, session: zenoh.Session) -> ThumperError:
        if not self._has_answered:
            return ThumperError(
                f"no robot {self.robot!r} answers on this bus; is that its name?",
                option="--robot",
                exit_code=EXIT_NOT_THERE,
            )
        reason = "no longer answers; it may still be driving: run `thumper stop`"
        if not session.info.routers_zid():  # a process that hangs keeps the connection
            reason = "has left the bus: its program has ended, so its wheels stop, or the network is down"
        return ThumperError(f"robot {self.robot!r} {reason}", exit_code=EXIT_NOT_THERE)


@contextmanager
def _readable_errors() -> Iterator[None]:
    """Re-raise Zenoh's errors as ThumperError; mostly another thread has closed the session."""
    try:
        yield
    except zenoh.ZError as error:
        raise ThumperError(f"the bus fails: {error}") from error
