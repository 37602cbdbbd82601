"""Limits of the web server: silent connections, abandoned pages, lines in the log, open files."""

import asyncio
import logging
import resource
from contextlib import suppress

import h11
from nicegui import Client
from uvicorn.protocols.http.h11_impl import H11Protocol

from thumper.common.texts import shortened
from thumper.dashboard.rate_limit import RateLimit

REQUEST_TIMEOUT_S = 10.0  # from the connection, later from the first byte, to the end of the request
UNFINISHED = (h11.IDLE, h11.SEND_BODY)  # states of a browser that has not sent its whole request
MAX_UNCONNECTED = 16  # pages that were sent to a browser and have not connected yet; each holds 0.7 MB
LOG_RATE_HZ, LOG_BURST = 1.0, 5


class TimedProtocol(H11Protocol):
    """HTTP that closes a connection which sends no complete request in time, the first one or a later one."""

    _deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the time limit of the first request."""
        super().connection_made(transport)
        self._expect_request()

    def data_received(self, data: bytes) -> None:
        """Start the time limit of a request with its first byte; end it with the last byte."""
        super().data_received(data)
        if self.conn.their_state not in UNFINISHED:
            self._cancel_deadline()
        elif self._deadline is None:
            self._expect_request()

    def connection_lost(self, exc: Exception | None) -> None:
        """End the time limit."""
        self._cancel_deadline()
        super().connection_lost(exc)

    def _expect_request(self) -> None:
        self._deadline = self.loop.call_later(REQUEST_TIMEOUT_S, self._close_if_unfinished)

    def _cancel_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _close_if_unfinished(self) -> None:
        self._deadline = None
        is_websocket = self.transport.get_protocol() is not self
        if not is_websocket and self.conn.their_state in UNFINISHED:
            self.transport.close()


class OneLineFormatter(logging.Formatter):
    """Formats a record as one line, without a traceback."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the first line of the message, and the exception."""
        text = record.getMessage().partition("\n")[0]
        error = record.exc_info[1] if record.exc_info else None
        return shortened(
            f"thumper: dashboard: {text}"
            + (f" ({type(error).__name__}: {error})" if error is not None else "")
        )


def limit_log() -> None:
    """Log warnings and errors of the server's libraries as single lines, at most one per second."""
    limit = RateLimit(LOG_RATE_HZ, LOG_BURST)
    handler = logging.StreamHandler()
    handler.setFormatter(OneLineFormatter())
    handler.addFilter(lambda _: limit.allows())
    logging.basicConfig(handlers=[handler], level=logging.WARNING, force=True)


def raise_file_limit() -> None:
    """Allow this process as many open files, and thus connections, as the system permits."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def drop_abandoned_pages() -> None:
    """Delete the oldest pages that no browser has connected to, so that visits cannot fill the memory."""
    waiting = [client for client in Client.instances.values() if not client.has_socket_connection]
    waiting.sort(key=lambda client: client.created)
    for client in waiting[:-MAX_UNCONNECTED]:
        client.delete()
