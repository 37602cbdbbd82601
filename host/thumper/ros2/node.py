"""One node in the ROS graph: its publishers, subscriptions and services on a Zenoh session."""

import itertools
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

import zenoh
from zenoh import ext

from thumper.common.closable import Closable
from thumper.ros.codec import Message, decode, encode
from thumper.ros2.interfaces import ros_typestore, type_hash
from thumper.ros2.wire import PUBLISHER, SERVICE, SUBSCRIPTION, Attachment, NodeName, Qos, gid_of


class MessageSink(Protocol):
    """Sends the messages of one topic."""

    def publish(self, raw: bytes) -> None:
        """Send a message that is already CDR."""
        ...


class GraphNode(Protocol):
    """What `RosGateway` and `RosServices` need of a node, of ROS or of another server."""

    def publisher(self, topic: str, type_name: str, qos: Qos) -> MessageSink:
        """Add a publisher."""
        ...

    def subscribe(self, topic: str, type_name: str, qos: Qos, callback: Callable[[bytes], None]) -> None:
        """Call `callback` with the CDR of each message."""
        ...

    def serve(self, service: str, type_name: str, answer: "Callable[[PendingCall], None]") -> None:
        """Call `answer` with each request."""
        ...


class PendingCall(Protocol):
    """A request that waits for its response."""

    request: Message

    def reply(self, response: Message) -> None:
        """Send the response."""
        ...


class RosPublisher:
    """Publishes messages that are already CDR, from any thread."""

    def __init__(self, publisher: "zenoh.Publisher | ext.AdvancedPublisher", gid: bytes) -> None:
        self._publisher, self._gid = publisher, gid
        self._sequences = itertools.count(1)

    def publish(self, raw: bytes) -> None:
        """Send a message; without effect after the session was closed."""
        attachment = Attachment(
            sequence=next(self._sequences), source_time_ns=time.time_ns(), gid=self._gid
        ).encode()
        with suppress(zenoh.ZError):
            self._publisher.put(raw, attachment=attachment)


class ServiceCall:
    """A request that waits for its response; it may wait for long."""

    def __init__(self, query: zenoh.Query, type_name: str) -> None:
        """Read the request; raises ValueError."""
        if query.payload is None or query.attachment is None:
            raise ValueError("the request has no content, or no attachment of rmw_zenoh")
        self.request: Message = decode(query.payload.to_bytes(), f"{type_name}_Request")
        self._attachment = Attachment.decode(query.attachment.to_bytes())
        self._query = query

    def reply(self, response: Message) -> None:
        """Send the response, once; without effect after the session was closed."""
        attachment = Attachment(
            sequence=self._attachment.sequence, source_time_ns=time.time_ns(), gid=self._attachment.gid
        )
        with suppress(zenoh.ZError):
            self._query.reply(self._query.key_expr, encode(response), attachment=attachment.encode())
        self._query.drop()  # type: ignore[no-untyped-call]


class RosNode(Closable):
    """A node that exists while its session does.

    Each endpoint gets its liveliness token after it works: whoever sees it in the graph can use it.
    """

    def __init__(self, name: NodeName, session: zenoh.Session) -> None:
        """Take over the session: `close` closes it."""
        ros_typestore()  # from here on the codec knows services and actions
        self.name = name
        self._session = session
        self._session_id = str(session.info.zid())
        self._numbers = itertools.count(1)  # 0 is the node
        self._endpoints: list[object] = []  # each ends when it is forgotten
        self._tokens = [session.liveliness().declare_token(name.node_token(self._session_id))]

    def publisher(self, topic: str, type_name: str, qos: Qos) -> RosPublisher:
        """Add a publisher."""
        endpoint = self._endpoint(topic, type_name)
        key = self.name.data_key(*endpoint)
        token = self._endpoint_token(PUBLISHER, endpoint, qos)
        publisher: zenoh.Publisher | ext.AdvancedPublisher
        if qos.is_latched:
            publisher = ext.declare_advanced_publisher(
                self._session, key, cache=ext.CacheConfig(qos.depth), publisher_detection=True
            )
        else:
            publisher = self._session.declare_publisher(key)
        self._announce(publisher, token)
        return RosPublisher(publisher, gid_of(token))

    def subscribe(self, topic: str, type_name: str, qos: Qos, callback: Callable[[bytes], None]) -> None:
        """Call `callback`, in a thread of the session, with the CDR of each message. It must not raise."""
        endpoint = self._endpoint(topic, type_name)

        def receive(sample: zenoh.Sample) -> None:
            callback(sample.payload.to_bytes())

        subscriber = self._session.declare_subscriber(self.name.data_key(*endpoint), receive)
        self._announce(subscriber, self._endpoint_token(SUBSCRIPTION, endpoint, qos))

    def serve(self, service: str, type_name: str, answer: Callable[[ServiceCall], None]) -> None:
        """Call `answer` with each request, in a thread of this service, one at a time.

        It replies now or later. Requests that are not valid get an error without it.
        """
        endpoint = self._endpoint(service, type_name)

        def receive(query: zenoh.Query) -> None:
            try:
                call = ServiceCall(query, type_name)
            except ValueError as error:
                query.reply_err(str(error))
                query.drop()  # type: ignore[no-untyped-call]
            else:
                answer(call)

        queryable = self._session.declare_queryable(self.name.data_key(*endpoint), receive, complete=True)
        self._announce(queryable, self._endpoint_token(SERVICE, endpoint, Qos()))

    @property
    def is_connected(self) -> bool:
        """Whether the router is there. Zenoh connects again when it returns."""
        return bool(self._session.info.routers_zid())

    def close(self) -> None:
        """Leave the graph."""
        self._session.close()  # type: ignore[no-untyped-call]

    def _endpoint(self, name: str, type_name: str) -> tuple[str, str, str]:
        return self.name.qualified(name), type_name, type_hash(type_name)

    def _endpoint_token(self, kind: str, endpoint: tuple[str, str, str], qos: Qos) -> str:
        return self.name.endpoint_token(self._session_id, next(self._numbers), kind, endpoint, qos)

    def _announce(self, entity: object, token: str) -> None:
        self._endpoints.append(entity)
        self._tokens.append(self._session.liveliness().declare_token(token))
