"""A rosbridge v2 server: WebSocket and JSON for programs without Zenoh.

It runs as a client of the bus in its own process, so it cannot delay the robot. The robot checks its requests
as it checks everybody's. The protocol is in ROSBRIDGE_PROTOCOL.md of RobotWebTools/rosbridge_suite.
"""

import asyncio
import hmac
import json
import ssl
import uuid
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from http import HTTPStatus
from typing import Any
from urllib.parse import parse_qs, urlsplit

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from thumper.bus.client import BusClient
from thumper.bus.request_decoder import MAX_MESSAGE_BYTES, json_object
from thumper.bus.rosbridge_ops import PendingQuery, RosbridgeClient
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.texts import shortened
from thumper.config.bus import is_loopback
from thumper.ros.codec import Message
from thumper.ros.to_json import to_json

MAX_CLIENTS = 16
MAX_QUEUED = 64  # per client; a slow client loses the oldest messages
MAX_PENDING_QUERIES = 20  # per client, waiting for the robot's answer
CLOSE_TIMEOUT_S = 1.0  # a client that reads nothing must not delay the shutdown


class Rosbridge:
    """Serves the bus of one robot on one port."""

    def __init__(
        self, bus: BusClient, *, host: str, port: int, token: str, tls: ssl.SSLContext | None = None
    ) -> None:
        if not token:
            raise ThumperError("rosbridge needs a token: set [bus] token", exit_code=EXIT_USAGE)
        if not is_loopback(host) and tls is None:
            raise ThumperError(
                f"rosbridge on {host} needs a certificate, or anybody could read the token: "
                "run `thumper dashboard --make-certificate` once, or set [dashboard] certificate and key",
                exit_code=EXIT_USAGE,
            )
        self._bus, self._host, self._port, self._token, self._tls = bus, host, port, token, tls
        self._topics: set[str] = set()
        self._clients: set[RosbridgeClient] = set()
        self._newest: dict[str, str] = {}

    async def serve(self, on_ready: Callable[[int], None]) -> None:
        """Serve until cancelled; calls `on_ready` with the port.

        Raises
        ------
        ThumperError
            The port is in use.
        """
        try:
            server: Server = await serve(
                self._serve_client,
                self._host,
                self._port,
                ssl=self._tls,
                process_request=self._admit,
                max_size=MAX_MESSAGE_BYTES,
                max_queue=4,
                close_timeout=CLOSE_TIMEOUT_S,
            )
        except OSError as error:
            raise ThumperError(
                f"rosbridge cannot listen at {self._host}:{self._port}: {error.strerror}; choose another port"
            ) from error
        async with server:
            on_ready(next(iter(server.sockets)).getsockname()[1])
            await server.serve_forever()

    def request_topic(self, topic: str) -> str | None:
        """Subscribe to a topic of the bus; return its newest message if one has come already."""
        if topic not in self._topics:
            self._topics.add(topic)
            loop = asyncio.get_running_loop()
            loop.run_in_executor(None, self._subscribe, loop, topic)  # it may wait for a latched message
        return self._newest.get(topic)

    def _subscribe(self, loop: asyncio.AbstractEventLoop, topic: str) -> None:
        try:
            self._bus.subscribe(topic, partial(self._on_message, loop, topic))
        except ThumperError:
            self._topics.discard(topic)  # the next client that wants it tries again

    def _on_message(self, loop: asyncio.AbstractEventLoop, topic: str, message: Message) -> None:
        text = json.dumps(to_json(message))
        with suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(self._deliver, topic, text)

    def _deliver(self, topic: str, text: str) -> None:
        self._newest[topic] = text
        for client in self._clients:
            client.on_message(topic, text)

    def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        """Refuse clients without the token, whatever their origin: any web page can connect to loopback."""
        if len(self._clients) >= MAX_CLIENTS:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "too many clients\n")
        # Browsers cannot set headers of a WebSocket, so pages pass the token in the address.
        query = parse_qs(urlsplit(request.path).query)
        header = request.headers.get("Authorization", "").removeprefix("Bearer ")
        given = header or query.get("token", [""])[0]
        if hmac.compare_digest(given.encode(), self._token.encode()):
            return None
        return connection.respond(
            HTTPStatus.UNAUTHORIZED,
            "send the header Authorization: Bearer TOKEN, or connect to /?token=TOKEN\n",
        )

    async def _serve_client(self, connection: ServerConnection) -> None:
        queue: asyncio.Queue[str] = asyncio.Queue()

        def send(text: str) -> None:
            while queue.qsize() >= MAX_QUEUED:
                queue.get_nowait()
            queue.put_nowait(text)

        source = f"rosbridge-{uuid.uuid4().hex[:12]}"
        client = RosbridgeClient(self._bus, self.request_topic, send, source=source)
        self._clients.add(client)
        queries: asyncio.Queue[PendingQuery] = asyncio.Queue(MAX_PENDING_QUERIES)
        workers = [
            asyncio.create_task(_write(connection, queue)),
            asyncio.create_task(self._answer(queries, send)),
        ]
        try:
            async for data in connection:
                _handle(client, data, queries, send)
        except ConnectionClosed:
            pass
        finally:
            self._clients.discard(client)
            for worker in workers:
                worker.cancel()

    async def _answer(self, queries: "asyncio.Queue[PendingQuery]", send: Callable[[str], None]) -> None:
        """Run a client's queries one after another, so that its stops and heartbeats never wait for one."""
        while True:
            query = await queries.get()
            send(json.dumps(await asyncio.get_running_loop().run_in_executor(None, query)))


def _handle(
    client: RosbridgeClient,
    data: str | bytes,
    queries: "asyncio.Queue[PendingQuery]",
    send: Callable[[str], None],
) -> None:
    message_id: Any = None
    try:
        content = json_object(data if isinstance(data, str) else data.decode())
        message_id = content.get("id")
        query = client.handle(content)
        if query is None:
            return
        if queries.full():
            raise ThumperError("too many service calls are pending; try again")
        queries.put_nowait(query)
    except (ValueError, ThumperError) as error:
        status = {"op": "status", "level": "error", "msg": shortened(str(error))}
        send(json.dumps(status | ({"id": message_id} if isinstance(message_id, str) else {})))


async def _write(connection: ServerConnection, queue: "asyncio.Queue[str]") -> None:
    try:
        while True:
            await connection.send(await queue.get())
    except ConnectionClosed:
        pass
