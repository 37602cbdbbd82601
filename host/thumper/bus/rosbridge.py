"""A rosbridge v2 server beside the robot: WebSocket and JSON for those who do not speak Zenoh.

It is a client of the bus in a process of its own, so it can delay nobody; what comes in is checked by the
robot like everything else. The protocol is in ROSBRIDGE_PROTOCOL.md of RobotWebTools/rosbridge_suite.
"""

import asyncio
import hmac
import json
import re
import ssl
import uuid
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from thumper.bus.client import BusClient
from thumper.bus.request_decoder import MOST_BYTES, json_object
from thumper.bus.rosbridge_ops import Conversation, Question
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.config.bus import is_loopback
from thumper.ros.codec import Message
from thumper.ros.to_json import to_json

MOST_CLIENTS = 16
MOST_QUEUED = 64  # of a client that is slow; the oldest go
MOST_QUESTIONS = 20  # of a client, that wait for the robot
CLOSE_TIMEOUT_S = 1.0  # a client that reads nothing must not hold up the end
OWN_PAGES = re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")


class Rosbridge:
    """Serves the bus of one robot at one port."""

    def __init__(
        self, bus: BusClient, *, host: str, port: int, token: str, tls: ssl.SSLContext | None = None
    ) -> None:
        if not is_loopback(host) and not token:
            raise ThumperError(
                f"{host} can be reached from other machines: set [bus] token as well", exit_code=EXIT_USAGE
            )
        if not is_loopback(host) and tls is None:
            raise ThumperError(
                f"rosbridge on {host} needs a certificate, or anybody could read the token: "
                "run `thumper dashboard --make-certificate` once, or set [dashboard] certificate and key",
                exit_code=EXIT_USAGE,
            )
        self._bus, self._host, self._port, self._token, self._tls = bus, host, port, token, tls
        self._topics: set[str] = set()
        self._clients: set[Conversation] = set()
        self._newest: dict[str, str] = {}

    async def serve(self, on_ready: Callable[[int], None]) -> None:
        """Serve until cancelled; `on_ready` is told the port.

        Raises
        ------
        ThumperError
            The port is taken.
        """
        self._loop = asyncio.get_running_loop()
        try:
            server: Server = await serve(
                self._talk,
                self._host,
                self._port,
                ssl=self._tls,
                process_request=self._admit,
                max_size=MOST_BYTES,
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

    def want(self, topic: str) -> str | None:
        """Have a topic from the bus from now on; returns its newest message, if there is one already."""
        if topic not in self._topics:
            self._topics.add(topic)
            # Subscribing may wait for a latched message: not in the loop that serves everybody.
            self._loop.run_in_executor(None, self._bus.subscribe, topic, lambda of: self._take(topic, of))
        return self._newest.get(topic)

    def _take(self, topic: str, message: Message) -> None:
        text = json.dumps(to_json(message))
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._deliver, topic, text)

    def _deliver(self, topic: str, text: str) -> None:
        self._newest[topic] = text
        for client in self._clients:
            client.hear(topic, text)

    def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        """Nobody without the token; and no foreign page in a browser of this machine."""
        if len(self._clients) >= MOST_CLIENTS:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "too many clients\n")
        if self._token:
            given = request.headers.get("Authorization", "").removeprefix("Bearer ")
            if not hmac.compare_digest(given.encode(), self._token.encode()):
                return connection.respond(HTTPStatus.UNAUTHORIZED, "Authorization: Bearer TOKEN is needed\n")
            return None
        origin = request.headers.get("Origin")
        if origin is not None and not OWN_PAGES.fullmatch(origin):
            return connection.respond(HTTPStatus.FORBIDDEN, "pages from elsewhere need a token\n")
        return None

    async def _talk(self, connection: ServerConnection) -> None:
        queue: asyncio.Queue[str] = asyncio.Queue()

        def send(text: str) -> None:
            while queue.qsize() >= MOST_QUEUED:
                queue.get_nowait()
            queue.put_nowait(text)

        client = Conversation(self._bus, self.want, send, source=f"rosbridge-{uuid.uuid4().hex[:12]}")
        self._clients.add(client)
        questions: asyncio.Queue[Question] = asyncio.Queue(MOST_QUESTIONS)
        workers = [
            asyncio.create_task(_write(connection, queue)),
            asyncio.create_task(self._answer(questions, send)),
        ]
        try:
            async for data in connection:
                _do(client, data, questions, send)
        except ConnectionClosed:
            pass
        finally:
            self._clients.discard(client)
            for worker in workers:
                worker.cancel()

    async def _answer(self, questions: "asyncio.Queue[Question]", send: Callable[[str], None]) -> None:
        """One after another, beside what else the client sends: no stop or heartbeat waits for an answer."""
        while True:
            question = await questions.get()
            send(json.dumps(await self._loop.run_in_executor(None, question)))


def _do(
    client: Conversation, data: str | bytes, questions: "asyncio.Queue[Question]", send: Callable[[str], None]
) -> None:
    answer_id: Any = None
    try:
        content = json_object(data if isinstance(data, str) else data.decode())
        answer_id = content.get("id")
        question = client.take(content)
        if question is None:
            return
        if questions.full():
            raise ThumperError("too many questions to the robot wait already: ask again")
        questions.put_nowait(question)
    except (ValueError, ThumperError) as error:
        status = {"op": "status", "level": "error", "msg": str(error)}
        send(json.dumps(status | ({"id": answer_id} if isinstance(answer_id, str) else {})))


async def _write(connection: ServerConnection, queue: "asyncio.Queue[str]") -> None:
    try:
        while True:
            await connection.send(await queue.get())
    except ConnectionClosed:
        pass
