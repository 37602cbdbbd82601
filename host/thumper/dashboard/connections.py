"""The pages that are open, and the one tick that feeds them all."""

import asyncio
import json
import secrets
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from thumper.common.errors import ThumperError
from thumper.dashboard.page_commands import PageCommands, Question
from thumper.dashboard.page_messages import (
    LARGEST_ORDER_BYTES,
    EStop,
    PageHeartbeat,
    PageMessageError,
    read_order,
)
from thumper.dashboard.page_state import PageState
from thumper.dashboard.rate_limit import RateLimit

PERIOD_S = 0.05  # at least 20 packets a second, so that a page knows the line is alive
SPACING_S = 0.02  # and at most 50: news goes out at once, a burst of news goes out together
SETTLE_S = 0.003  # a beat's messages come one after the other within this time
MOST_PAGES = 16  # their heartbeats together stay within what the robot takes
MOST_WAITING = 20  # packets, a second: a page further behind is given the whole picture when it can take it
ORDER_RATE_HZ = 60.0  # heartbeats are 10, the stick is 20
ORDER_BURST = 60
MOST_QUESTIONS = 4  # of a page at once


class PageConnection:
    """One open page: what waits to be sent to it."""

    def __init__(self, socket: WebSocket) -> None:
        self.name = secrets.token_hex(4)
        self.socket = socket
        self.waiting: deque[bytes | str] = deque()
        self.behind = True  # a new page needs the whole picture
        self.news = asyncio.Event()
        self.questions: set[asyncio.Task[None]] = set()

    def give(self, packet: bytes) -> None:
        """Queue a packet; never waits."""
        if len(self.waiting) >= MOST_WAITING:
            self.waiting.clear()
            self.behind = True
        if not self.behind:
            self.waiting.append(packet)
        self.news.set()

    def say(self, kind: str, **content: Any) -> None:
        """Queue a small text message."""
        if len(self.waiting) < 2 * MOST_WAITING:
            self.waiting.append(json.dumps({"kind": kind, **content}))
            self.news.set()


class Connections:
    """All open pages of one robot."""

    def __init__(self, view: PageState, helm: PageCommands, extra: Callable[[], dict[str, Any]]) -> None:
        self._view = view
        self._helm = helm
        self._extra = extra
        self._pages: set[PageConnection] = set()
        self._changed = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None

    def on_change(self) -> None:
        """Wake the tick; on any thread."""
        if self._loop is not None:
            with suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._changed.set)

    async def run(self) -> None:
        """Tick until cancelled."""
        self._loop = asyncio.get_running_loop()
        while True:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._changed.wait(), PERIOD_S)
                await asyncio.sleep(SETTLE_S)
            self._changed.clear()
            begun_s = time.monotonic()
            packet = self._view.tick(self._about())
            for page in self._pages:
                page.give(packet)
            await asyncio.sleep(max(0.0, SPACING_S - (time.monotonic() - begun_s)))

    async def serve(self, socket: WebSocket) -> None:
        """Serve one page until it goes."""
        if len(self._pages) >= MOST_PAGES:
            await socket.close(code=1013, reason="too many pages")
            return
        await socket.accept()
        page = PageConnection(socket)
        page.say("hello", me=page.name)
        self._pages.add(page)
        sender = asyncio.create_task(self._send(page))
        try:
            await self._receive(page)
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._pages.discard(page)
            self._helm.leave(page.name)
            sender.cancel()

    def _about(self) -> dict[str, Any]:
        return {"pages": len(self._pages), "operator": self._helm.newest, **self._extra()}

    async def _send(self, page: PageConnection) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):
            while True:
                await page.news.wait()
                page.news.clear()
                while page.waiting:
                    item = page.waiting.popleft()
                    await (
                        page.socket.send_text(item) if isinstance(item, str) else page.socket.send_bytes(item)
                    )
                if page.behind:
                    page.behind = False
                    await page.socket.send_bytes(self._view.whole(self._about()))

    async def _receive(self, page: PageConnection) -> None:
        limit = RateLimit(ORDER_RATE_HZ, ORDER_BURST)
        while True:
            text = await page.socket.receive_text()
            allowed = limit.allows()
            if len(text) > LARGEST_ORDER_BYTES:
                await page.socket.close(code=1009, reason="too long")
                return
            try:
                order = read_order(text)
            except PageMessageError as error:
                if allowed:
                    page.say("refused", text=str(error))
                continue
            if not allowed and not isinstance(order, EStop):
                continue  # a flood; a stop is always heard
            question = self._helm.obey(page.name, order)
            if question is not None:
                self._ask(page, question)
            if isinstance(order, PageHeartbeat):
                page.say("beat", n=order.n)

    def _ask(self, page: PageConnection, question: Question) -> None:
        """Have the robot answer on a thread; heartbeats must not wait for it."""
        if len(page.questions) >= MOST_QUESTIONS:
            page.say("refused", text="wait for the robot's answer to what you asked before")
            return

        async def ask() -> None:
            try:
                if text := await asyncio.to_thread(question):
                    page.say("note", text=text)
            except ThumperError as error:
                page.say("refused", text=str(error))

        task = asyncio.create_task(ask())
        page.questions.add(task)
        task.add_done_callback(page.questions.discard)
