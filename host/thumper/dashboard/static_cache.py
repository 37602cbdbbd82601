"""Keep the page's compressed scripts and styles in memory: reading and compressing one takes 4 to 29 ms."""

from starlette.types import ASGIApp, Message, Receive, Scope, Send

CACHED = tuple(f"/{kind}/" for kind in ("static", "components", "esm"))  # below NiceGUI's version
MAX_BYTES = 8_000_000  # the page has 1


class StaticCache:
    """ASGI middleware: answers a repeated GET of a static file with its first answer."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._answers: dict[tuple[str, bool], list[Message]] = {}
        self._size_bytes = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer from memory, or pass the request on and keep a whole answer."""
        if not _is_static(scope):
            await self._app(scope, receive, send)
            return
        headers = dict(scope["headers"])
        key = (scope["path"], b"gzip" in headers.get(b"accept-encoding", b""))
        if key not in self._answers:
            await self._app(scope, receive, self._kept(key, send))
            return
        for message in self._answers[key]:
            await send(dict(message))  # another middleware adds headers

    def _kept(self, key: tuple[str, bool], send: Send) -> Send:
        messages: list[Message] = []

        async def keep(message: Message) -> None:
            messages.append(dict(message))
            await send(message)
            if messages[0].get("status") == 200 and not message.get("more_body", "body" not in message):
                size_bytes = sum(len(part.get("body", b"")) for part in messages)
                if self._size_bytes + size_bytes <= MAX_BYTES:
                    self._size_bytes += size_bytes
                    self._answers[key] = messages

        return keep


def _is_static(scope: Scope) -> bool:
    if scope["type"] != "http" or scope["method"] != "GET" or not scope["path"].startswith("/_nicegui/"):
        return False
    is_partial = any(
        name in (b"range", b"if-none-match", b"if-modified-since") for name, _ in scope["headers"]
    )
    return not is_partial and any(kind in scope["path"] for kind in CACHED)
