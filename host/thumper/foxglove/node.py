"""A node as `thumper.ros2.node.RosNode`, whose topics are channels of a Foxglove server instead of ROS.

The server speaks foxglove.sdk.v1, on loopback behind TLS with a key that only this process has: web
pages reach it only through `TokenGate`. A program on this computer that ignores certificates passes the gate.
"""

import functools
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import foxglove
from foxglove.websocket import (
    Capability,
    ChannelView,
    Client,
    ClientChannel,
    MessageSchema,
    Parameter,
    ParameterType,
    ServerListener,
    Service,
    ServiceRequest,
    ServiceSchema,
    WebSocketServer,
)

from thumper.bus.client import BusClient
from thumper.common.certificates import make_pair
from thumper.common.closable import Closable
from thumper.common.errors import ThumperError
from thumper.ros import services
from thumper.ros.codec import Message, decode, definition, encode
from thumper.ros2.interfaces import ros_typestore
from thumper.ros2.wire import NodeName, Qos

LOOPBACK = "127.0.0.1"
CDR = "cdr"


class ChannelPublisher:
    """Sends messages that are already CDR to every client that has subscribed."""

    def __init__(self, channel: foxglove.Channel, *, latched: bool) -> None:
        self._channel, self._latched = channel, latched
        self._newest: bytes | None = None

    def publish(self, raw: bytes) -> None:
        """Send a message."""
        if self._latched:
            self._newest = raw
        self._channel.log(raw)

    def repeat(self) -> None:
        """Send a latched topic's newest message again, for a new subscriber."""
        if self._newest is not None:
            self._channel.log(self._newest)


class PanelCall:
    """A service call from a panel, which waits for `reply`."""

    def __init__(self, request: Message) -> None:
        self.request = request
        self.response = b""

    def reply(self, response: Message) -> None:
        """Set the response."""
        self.response = encode(response)


class FoxgloveNode(Closable):
    """Add publishers, subscriptions and services, then `start`."""

    def __init__(self, name: NodeName, parameters: "PanelParameters") -> None:
        ros_typestore()
        self._parameters = parameters
        self.name = name
        self.folder = tempfile.TemporaryDirectory(prefix="thumper-")
        self._context = foxglove.Context()
        self._publishers: dict[str, ChannelPublisher] = {}
        self._inputs: dict[tuple[str, str], Callable[[bytes], None]] = {}
        self._services: list[Service] = []
        self._server: WebSocketServer | None = None

    @property
    def certificate(self) -> Path:
        """The certificate by which the gate recognizes the server."""
        return Path(self.folder.name) / "server.crt"

    def publisher(self, topic: str, type_name: str, qos: Qos) -> ChannelPublisher:
        """Add a channel."""
        channel = foxglove.Channel(
            self.name.qualified(topic), message_encoding=CDR, schema=_schema(type_name), context=self._context
        )
        publisher = ChannelPublisher(channel, latched=qos.is_latched)
        self._publishers[channel.topic()] = publisher
        return publisher

    def subscribe(self, topic: str, type_name: str, _qos: Qos, callback: Callable[[bytes], None]) -> None:
        """Call `callback` with the CDR of each message that a client publishes."""
        self._inputs[self.name.qualified(topic), type_name] = callback

    def serve(self, service: str, type_name: str, answer: Callable[[PanelCall], None]) -> None:
        """Call `answer` with each request; it replies before it returns. Call it before `start`."""

        def handle(request: ServiceRequest) -> bytes:
            call = PanelCall(decode(request.payload, f"{type_name}_Request"))
            answer(call)
            return call.response

        request, response = (
            MessageSchema(encoding=CDR, schema=_schema(f"{type_name}_{part}"))
            for part in ("Request", "Response")
        )
        schema = ServiceSchema(type_name, request=request, response=response)
        self._services.append(Service(self.name.qualified(service), schema=schema, handler=handle))

    def start(self) -> int:
        """Listen on loopback, behind TLS, and return the port."""
        pair = make_pair("Thumper", [LOOPBACK])
        key = self.certificate.with_suffix(".key")
        pair.write(self.certificate, key)
        self._server = foxglove.start_server(
            name=self.name.name,
            host=LOOPBACK,
            port=0,
            capabilities=[Capability.ClientPublish, Capability.Services, Capability.Parameters],
            supported_encodings=[CDR],
            server_listener=_Listener(self._publishers, self._inputs, self._parameters),
            services=self._services,
            context=self._context,
            tls_cert=self.certificate.read_bytes(),
            tls_key=key.read_bytes(),
        )
        return self._server.port

    def close(self) -> None:
        """Disconnect all clients."""
        if self._server is not None:
            self._server.stop()
        self.folder.cleanup()


class _Listener(ServerListener):
    """Repeats latched messages, and passes on what clients publish."""

    def __init__(
        self,
        publishers: dict[str, ChannelPublisher],
        inputs: dict[tuple[str, str], Callable[[bytes], None]],
        parameters: "PanelParameters",
    ) -> None:
        self._publishers, self._inputs, self._parameters = publishers, inputs, parameters
        self._channels: dict[tuple[int, int], Callable[[bytes], None]] = {}

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        if publisher := self._publishers.get(channel.topic):
            publisher.repeat()

    def on_client_advertise(self, client: Client, channel: ClientChannel) -> None:
        callback = self._inputs.get((channel.topic, _full(channel.schema_name)))
        if callback is not None and channel.encoding == CDR:
            self._channels[client.id, channel.id] = callback

    def on_client_unadvertise(self, client: Client, client_channel_id: int) -> None:
        self._channels.pop((client.id, client_channel_id), None)

    def on_message_data(self, client: Client, client_channel_id: int, data: bytes) -> None:
        if callback := self._channels.get((client.id, client_channel_id)):
            callback(data)

    def on_get_parameters(
        self, client: Client, param_names: list[str], request_id: str | None = None
    ) -> list[Parameter]:
        return _numbers(self._parameters.values(), param_names)

    def on_set_parameters(
        self, client: Client, parameters: list[Parameter], request_id: str | None = None
    ) -> list[Parameter]:
        wanted = {one.name: one.get_value() for one in parameters}
        return _numbers(self._parameters.change(wanted), list(wanted))


class PanelParameters:
    """The parameters of the board, for the Parameters panel. The board checks ranges as always."""

    def __init__(self, bus: BusClient, report: Callable[[str], None]) -> None:
        """`report` receives a line if the robot refuses a change."""
        self._bus, self._report = bus, report

    def values(self) -> dict[str, float]:
        """Return the values in use; none without a robot."""
        try:
            return services.PARAMETERS_GET.call(self._bus).values
        except ThumperError:
            return {}

    def change(self, content: Mapping[str, object]) -> dict[str, float]:
        """Set all or none; return the values in use after it."""
        others = [name for name, value in content.items() if not isinstance(value, int | float)]
        try:
            if others:  # panels can also send texts, bytes and lists
                raise ThumperError(f"{others[0]} is a number")
            services.PARAMETERS_SET.call(self._bus, content)
        except ThumperError as error:
            self._report(str(error))
        return self.values()


def _numbers(values: Mapping[str, float], names: list[str]) -> list[Parameter]:
    """Return the values of these names, of all if there are none."""
    chosen = [name for name in names or values if name in values]
    return [Parameter(name, value=float(values[name]), type=ParameterType.Float64) for name in chosen]


@functools.cache
def _schema(type_name: str) -> foxglove.Schema:
    return foxglove.Schema(name=type_name, encoding="ros2msg", data=definition(type_name).encode())


def _full(type_name: str) -> str:
    """Return the name with `msg` in the middle, which panels leave out at times."""
    parts = type_name.split("/")
    return f"{parts[0]}/msg/{parts[-1]}"
