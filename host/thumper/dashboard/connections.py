"""Connections of the open pages, and the tick that sends to all of them."""

import asyncio
import json
import secrets
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from fastapi import FastAPI
from starlette.websockets import WebSocket, WebSocketDisconnect

from thumper.common.errors import ThumperError
from thumper.dashboard.page_commands import PageCommands, PendingQuery
from thumper.dashboard.page_messages import (
    MAX_MESSAGE_BYTES,
    EStop,
    PageHeartbeat,
    PageMessage,
    PageMessageError,
    TakeControl,
    parse_message,
)
from thumper.dashboard.page_state import PageState
from thumper.dashboard.rate_limit import RateLimit

MAX_PERIOD_S = 0.05  # at least 20 packets per second, so that a page knows that the connection is alive
MIN_PERIOD_S = 0.02  # and at most 50: a change is sent at once, a burst of changes together
BATCH_WINDOW_S = 0.003  # the messages of one control cycle arrive within this time
MAX_PAGES = 16  # their heartbeats together stay below the robot's rate limit
SILENT_S = 5.0  # a page that is hidden sends nothing
MAX_QUEUED = 20  # packets, 1 s: a page further behind receives a full packet when it can take one
MESSAGE_RATE_HZ = 60.0  # heartbeats are 20, the stick is 20
MESSAGE_BURST = 60
ANSWER_RATE_HZ, ANSWER_BURST = 1.0, 5  # refusals that a page is shown
MAX_PENDING_QUERIES = 4  # per page


class PageConnection:
    """One open page and the queue of what is to be sent to it."""

    def __init__(self, socket: WebSocket) -> None:
        self.name = secrets.token_hex(4)
        self.socket = socket
        self.queue: deque[bytes | str] = deque()
        self.needs_full_packet = True  # as every new page
        self.received_s = time.monotonic()
        self.has_queued = asyncio.Event()
        self.queries: set[asyncio.Task[None]] = set()

    def send_packet(self, packet: bytes) -> None:
        """Queue a packet. Never blocks."""
        if len(self.queue) >= MAX_QUEUED:
            self.queue.clear()
            self.needs_full_packet = True
        if not self.needs_full_packet:
            self.queue.append(packet)
        self.has_queued.set()

    def send_text(self, kind: str, **content: Any) -> None:
        """Queue a JSON message."""
        if len(self.queue) < 2 * MAX_QUEUED:
            self.queue.append(json.dumps({"kind": kind, **content}))
            self.has_queued.set()


class Connections:
    """All open pages of one robot."""

    def __init__(self, state: PageState, commands: PageCommands, extra: Callable[[], dict[str, Any]]) -> None:
        """`extra` returns further values for each packet."""
        self._state = state
        self._commands = commands
        self._extra = extra
        self._pages: set[PageConnection] = set()
        self._changed = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None

    @property
    def count(self) -> int:
        """How many pages are connected."""
        return len(self._pages)

    def on_change(self) -> None:
        """Wake the tick. May be called from any thread."""
        if self._loop is not None:
            with suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._changed.set)

    async def run(self) -> None:
        """Tick until cancelled."""
        self._loop = asyncio.get_running_loop()
        while True:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._changed.wait(), MAX_PERIOD_S)
                await asyncio.sleep(BATCH_WINDOW_S)
            self._changed.clear()
            start_s = time.monotonic()
            packet = self._state.tick(self._common_values())
            for page in self._pages:
                page.send_packet(packet)
            await asyncio.sleep(max(0.0, MIN_PERIOD_S - (time.monotonic() - start_s)))

    async def serve(self, socket: WebSocket) -> None:
        """Serve one page until it disconnects."""
        if len(self._pages) >= MAX_PAGES and not await self._close_silent_page():
            await socket.close(code=1013, reason="too many pages")
            return
        await socket.accept()
        page = PageConnection(socket)
        page.send_text("hello", me=page.name)
        self._pages.add(page)
        sender = asyncio.create_task(self._send(page))
        try:
            await self._receive(page)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._pages.discard(page)
            self._commands.on_disconnect(page.name)
            sender.cancel()

    async def _close_silent_page(self) -> bool:
        """Close the page that has been silent the longest, to make room; return False if there is none."""
        page = min(self._pages, key=lambda page: page.received_s)
        if page.name == self._commands.operator or time.monotonic() - page.received_s < SILENT_S:
            return False
        self._pages.discard(page)
        await page.socket.close(code=1013, reason="too many pages")
        return True

    def _common_values(self) -> dict[str, Any]:
        return {"pages": self.count, "operator": self._commands.operator, **self._extra()}

    async def _send(self, page: PageConnection) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):
            while True:
                await page.has_queued.wait()
                page.has_queued.clear()
                while page.queue:
                    item = page.queue.popleft()
                    await (
                        page.socket.send_text(item) if isinstance(item, str) else page.socket.send_bytes(item)
                    )
                if page.needs_full_packet:
                    page.needs_full_packet = False
                    await page.socket.send_bytes(self._state.full_packet(self._common_values()))

    async def _receive(self, page: PageConnection) -> None:
        limit = RateLimit(MESSAGE_RATE_HZ, MESSAGE_BURST)
        answers = RateLimit(ANSWER_RATE_HZ, ANSWER_BURST)
        while True:
            received = await page.socket.receive()
            page.received_s = time.monotonic()
            text = received.get("text")
            if received["type"] == "websocket.disconnect":
                return
            if text is None or len(text) > MAX_MESSAGE_BYTES:
                reason = "send text" if text is None else "too long"
                await page.socket.close(code=1003 if text is None else 1009, reason=reason)
                return
            allowed = limit.allows()
            try:
                message = parse_message(text)
                if not allowed and not isinstance(message, EStop):
                    continue  # rate limit; an E-stop always passes
                self._handle(page, message)
            except (PageMessageError, ThumperError) as error:
                if allowed and answers.allows():  # a held joystick must not fill the page with notices
                    page.send_text("refused", text=str(error))

    def _handle(self, page: PageConnection, message: PageMessage) -> None:
        before = self._commands.operator
        query = self._commands.handle(page.name, message)
        if query is not None:
            self._run_query(page, query)
        if isinstance(message, PageHeartbeat):
            page.send_text("beat", n=message.n)
        if isinstance(message, TakeControl) and before != page.name:
            page.send_text("note", text="This page controls the robot now.")
            for other in self._pages:
                if other.name == before:
                    other.send_text(
                        "refused",
                        text="Another page has taken control: this page can no longer drive. A goal goes on.",
                    )

    def _run_query(self, page: PageConnection, query: PendingQuery) -> None:
        """Query the robot in a thread, so that heartbeats do not wait for its answer."""
        if len(page.queries) >= MAX_PENDING_QUERIES:
            page.send_text("refused", text="too many requests are pending; wait for the robot's answers")
            return

        async def run() -> None:
            try:
                if text := await asyncio.to_thread(query):
                    page.send_text("note", text=text)
            except ThumperError as error:
                page.send_text("refused", text=str(error))

        task = asyncio.create_task(run())
        page.queries.add(task)
        task.add_done_callback(page.queries.discard)


def add_stream(app: FastAPI, connections: Connections) -> None:
    """Add the pages' websocket, and how many pages are connected."""

    @app.websocket("/stream")
    async def stream(socket: WebSocket) -> None:
        await connections.serve(socket)

    @app.get("/pages")
    def pages() -> int:
        return connections.count
