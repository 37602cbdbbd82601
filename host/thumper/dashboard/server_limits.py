"""Limits of the web server: silent connections, abandoned pages, lines in the log, open files."""

import asyncio
import logging
import resource
from contextlib import suppress

from nicegui import Client
from uvicorn.protocols.http.h11_impl import H11Protocol

from thumper.common.texts import shortened
from thumper.dashboard.rate_limit import RateLimit

REQUEST_TIMEOUT_S = 10.0  # from the connection to the end of the request's headers
MAX_UNCONNECTED = 16  # pages that were sent to a browser and have not connected yet; each holds 0.7 MB
LOG_RATE_HZ, LOG_BURST = 1.0, 5


class TimedProtocol(H11Protocol):
    """HTTP that closes a connection which sends no complete request in time."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the time limit."""
        super().connection_made(transport)
        self.loop.call_later(REQUEST_TIMEOUT_S, self._close_if_silent)

    def _close_if_silent(self) -> None:
        is_websocket = self.transport.get_protocol() is not self
        if self.cycle is None and not is_websocket:
            self.transport.close()


class OneLineFormatter(logging.Formatter):
    """Formats a record as one line, without a traceback."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the first line of the message, and the exception."""
        text = record.getMessage().partition("\n")[0]
        error = record.exc_info[1] if record.exc_info else None
        return shortened(
            f"thumper: page: {text}" + (f" ({type(error).__name__}: {error})" if error is not None else "")
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
