"""Lets only programs with the token through to a server that knows no tokens.

It reads the head of the HTTP request that opens a websocket and then passes bytes on. A web page cannot guess
the token, whatever its origin.
"""

import asyncio
import hmac
import ssl
from collections.abc import Callable
from contextlib import suppress
from urllib.parse import parse_qs, urlsplit

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.config.bus import is_loopback

MAX_HEAD_BYTES = 8192
HEAD_TIMEOUT_S = 5.0
MAX_CLIENTS = 16
CHUNK_BYTES = 65536
REFUSAL = (
    b"HTTP/1.1 401 Unauthorized\r\nContent-Type: text/plain\r\nConnection: close\r\n\r\n"
    b"connect to /?token=TOKEN, or send the header Authorization: Bearer TOKEN\n"
)


class TokenGate:
    """Serves one address. `backend` is the port of the server behind it, `trust` how to connect there."""

    def __init__(
        self,
        *,
        host: str,
        port: int,
        token: str,
        backend: int,
        trust: ssl.SSLContext,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        if not token:
            raise ThumperError("the server needs a token: set [bus] token", exit_code=EXIT_USAGE)
        if not is_loopback(host) and tls is None:
            raise ThumperError(
                f"a server on {host} needs a certificate, or anybody could read the token: "
                "run `thumper dashboard --make-certificate` once, or set [dashboard] certificate and key",
                exit_code=EXIT_USAGE,
            )
        self._host, self._port, self._token, self._tls = host, port, token, tls
        self._backend, self._trust = backend, trust
        self._clients = 0

    async def serve(self, on_ready: Callable[[int], None]) -> None:
        """Serve until cancelled; calls `on_ready` with the port. Raises ThumperError if it is in use."""
        try:
            server = await asyncio.start_server(
                self._serve_client, self._host, self._port, ssl=self._tls, limit=MAX_HEAD_BYTES
            )
        except OSError as error:
            raise ThumperError(
                f"cannot listen at {self._host}:{self._port}: {error.strerror}; choose another port"
            ) from error
        async with server:
            on_ready(server.sockets[0].getsockname()[1])
            await server.serve_forever()

    async def _serve_client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._clients += 1
        try:
            with suppress(OSError, ValueError, TimeoutError, asyncio.IncompleteReadError):
                async with asyncio.timeout(HEAD_TIMEOUT_S):
                    head = await _read_head(reader)
                if self._clients > MAX_CLIENTS or not self._admits(head):
                    writer.write(REFUSAL)
                    await writer.drain()
                else:
                    await self._connect(head, reader, writer)
        finally:
            self._clients -= 1
            writer.close()

    def _admits(self, head: bytes) -> bool:
        """Return whether the request carries the token, in its address or its header."""
        request, *lines = head.decode("latin-1").split("\r\n")
        headers = {
            name.strip().lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)
        }
        parts = request.split(" ")
        query = parse_qs(urlsplit(parts[1]).query) if len(parts) == 3 else {}
        given = headers.get("authorization", "").removeprefix("Bearer ") or query.get("token", [""])[0]
        return hmac.compare_digest(given.encode(), self._token.encode())

    async def _connect(self, head: bytes, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        behind, before = await asyncio.open_connection("127.0.0.1", self._backend, ssl=self._trust)
        before.write(head)
        copies = {asyncio.create_task(_copy(reader, before)), asyncio.create_task(_copy(behind, writer))}
        try:
            await asyncio.wait(copies, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for copy in copies:
                copy.cancel()
            before.close()


async def _read_head(reader: asyncio.StreamReader) -> bytes:
    """Read up to the empty line; raises ValueError if the head is too long."""
    try:
        return await reader.readuntil(b"\r\n\r\n")
    except asyncio.LimitOverrunError as error:
        raise ValueError("the head of the request is too long") from error


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while chunk := await reader.read(CHUNK_BYTES):
            writer.write(chunk)
            await writer.drain()
