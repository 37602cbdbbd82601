"""One connection of a page: the rate limit, which never holds back an emergency stop. No server."""

import asyncio
import json
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from thumper.common.errors import ThumperError
from thumper.dashboard.connections import ANSWER_BURST, MESSAGE_BURST, Connections, PageConnection
from thumper.dashboard.page_messages import MAX_MESSAGE_BYTES

ARM = '{"kind": "command", "name": "arm"}'
ESTOP = '{"kind": "estop"}'


class Commands:
    """Counts what the pages request."""

    def __init__(self, refusal: str = "") -> None:
        self.operator = ""
        self.refusal = refusal
        self.handled: Counter[str] = Counter()

    def handle(self, _page: str, message: Any) -> None:
        self.handled[message.kind] += 1
        if self.refusal:
            raise ThumperError(self.refusal)


class Socket:
    """Delivers messages, then disconnects."""

    def __init__(self, messages: Sequence[str | bytes]) -> None:
        self.messages = list(messages)
        self.closed: list[int] = []

    async def receive(self) -> dict[str, Any]:
        if not self.messages:
            return {"type": "websocket.disconnect"}
        message = self.messages.pop(0)
        return {"type": "websocket.receive", "text" if isinstance(message, str) else "bytes": message}

    async def close(self, code: int, reason: str) -> None:
        assert reason
        self.closed.append(code)


def deliver(
    messages: Sequence[str | bytes], refusal: str = ""
) -> tuple[Commands, Socket, list[dict[str, Any]]]:
    """Return the commands, the socket and the texts for the page."""
    commands, socket = Commands(refusal), Socket(messages)
    page = PageConnection(socket)  # type: ignore[arg-type]
    connections = Connections(None, commands, dict)  # type: ignore[arg-type]
    with ThreadPoolExecutor(1) as thread:  # the event loop of the browser's tests runs in this one
        thread.submit(asyncio.run, connections._receive(page)).result()
    return commands, socket, [json.loads(text) for text in page.queue if isinstance(text, str)]


def test_an_emergency_stop_passes_in_a_flood() -> None:
    commands, _, _ = deliver([ARM] * 500 + [ESTOP] * 3)
    assert MESSAGE_BURST <= commands.handled["command"] < MESSAGE_BURST + 50  # the others are dropped
    assert commands.handled["estop"] == 3


def test_a_flood_of_refusals_is_answered_a_few_times() -> None:
    _, _, texts = deliver([ARM] * 50, refusal="another page controls the robot")
    assert ANSWER_BURST <= len(texts) <= ANSWER_BURST + 2
    assert texts[0] == {"kind": "refused", "text": "another page controls the robot"}


def test_oversized_and_binary_messages_close_the_connection() -> None:
    for message, code in (("x" * (MAX_MESSAGE_BYTES + 1), 1009), (b"\x00", 1003)):
        commands, socket, _ = deliver([message, ESTOP])
        assert socket.closed == [code]
        assert not commands.handled
    _, socket, _ = deliver(["x" * MAX_MESSAGE_BYTES, ESTOP])
    assert socket.closed == []
