"""Access control: requests from the page itself only, and from those who know the password if one is set.

It covers everything, including NiceGUI's own paths and the websockets. It matters on loopback, too: without
it, any web page open in the user's browser could connect to the websocket and drive the robot.
"""

import asyncio
import hmac
import ipaddress
import secrets
import time
from html import escape
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from thumper.config.bus import is_loopback
from thumper.dashboard.rate_limit import RateLimit

ICON = (Path(__file__).parent / "static/icon.svg").read_text(encoding="utf-8")
COOKIE = "thumper_session"
SESSION_S = 12 * 3600.0
ATTEMPT_RATE_HZ, ATTEMPT_BURST = 0.2, 5  # guesses of the password per address
MAX_NETWORKS = 256  # whose attempts are remembered
MAX_FORM_BYTES = 2048
FORM_TIMEOUT_S = 10.0
# NiceGUI compiles its templates in the page, hence 'unsafe-eval'. No other host is involved.
STRICT_TRANSPORT = b"max-age=31536000"  # seconds: the browser uses HTTPS only, for a year
POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self'; object-src 'none'; base-uri 'self'; form-action 'self'; frame-ancestors 'self'"
)


class AccessControl:
    """ASGI middleware that checks host, origin and session of every request and websocket."""

    def __init__(self, app: ASGIApp, *, hosts: frozenset[str], password: str, secure: bool) -> None:
        """`hosts` are the accepted host names, empty for any; `secure` restricts the cookie to HTTPS."""
        self._app = app
        self._hosts = hosts
        self._password = password
        self._secure = secure
        self._sessions: dict[str, float] = {}
        self._attempts: dict[str, RateLimit] = {}  # per address: guesses lock out nobody else

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass allowed requests on to the application."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        if scope["type"] == "http":
            send = self._with_policy(send, headers)
        if not (self._is_same_page(headers) and _is_own_request(scope, headers)):
            await _refuse(scope, receive, send, PlainTextResponse("wrong host or origin", status_code=403))
        elif not self._password:
            await self._app(scope, receive, send)
        elif scope["type"] == "http" and scope["path"] == "/login":
            response = await self._login(Request(scope, receive))
            await response(scope, receive, send)
        elif not self._is_logged_in(headers):
            is_page = scope["type"] == "http" and "text/html" in headers.get("accept", "")
            login: Response = RedirectResponse("/login", status_code=303)
            await _refuse(scope, receive, send, login if is_page else PlainTextResponse("log in first", 401))
        elif scope["type"] == "http" and scope["path"] == "/logout":
            await self._logout(Request(scope, receive))(scope, receive, send)
        elif scope["type"] == "websocket":
            await self._app(scope, self._while_logged_in(headers, receive), send)
        else:
            await self._app(scope, receive, send)

    def _is_same_page(self, headers: Headers) -> bool:
        if self._hosts and _host_name(headers) not in self._hosts:
            return False  # a foreign name that points to this computer (DNS rebinding)
        origin = headers.get("origin")
        try:
            return origin is None or urlsplit(origin).netloc == headers.get("host", "")
        except ValueError:  # malformed
            return False

    def _with_policy(self, send: Send, headers: Headers) -> Send:
        """Return `send` with the headers that restrict what browsers do with an answer."""
        policy = [
            (b"content-security-policy", POLICY.encode()),
            (b"x-content-type-options", b"nosniff"),
            (b"referrer-policy", b"same-origin"),  # no-referrer: Chromium posts forms without an origin
        ]
        if self._secure and not is_loopback(_host_name(headers)):  # other programs there have no HTTPS
            policy.append((b"strict-transport-security", STRICT_TRANSPORT))

        async def send_with_policy(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *policy]
            await send(message)

        return send_with_policy

    def _is_logged_in(self, headers: Headers) -> bool:
        return self._sessions.get(_session_of(headers), 0.0) > time.monotonic()

    def _while_logged_in(self, headers: Headers, receive: Receive) -> Receive:
        """Return `receive` of a websocket that ends with the session."""

        async def receive_if_logged_in() -> Message:
            message = await receive()
            if self._is_logged_in(headers):
                return message
            return {"type": "websocket.disconnect", "code": 1008}

        return receive_if_logged_in

    def _may_try(self, network: str) -> bool:
        """Count an attempt from this network; return False if there were too many."""
        attempts = self._attempts.pop(network, None) or RateLimit(ATTEMPT_RATE_HZ, ATTEMPT_BURST)
        self._attempts[network] = attempts  # the newest is the last
        while len(self._attempts) > MAX_NETWORKS:
            self._attempts.pop(next(iter(self._attempts)))
        return attempts.allows()

    def _logout(self, request: Request) -> Response:
        if request.method != "POST":
            return PlainTextResponse("send POST", status_code=405)
        self._sessions.pop(_session_of(request.headers), None)
        answer = RedirectResponse("/login", status_code=303)
        answer.delete_cookie(COOKIE)
        return answer

    async def _login(self, request: Request) -> Response:
        if request.method != "POST":
            return HTMLResponse(_form(""))
        body = b""
        try:
            async with asyncio.timeout(FORM_TIMEOUT_S):
                async for chunk in request.stream():
                    body += chunk
                    if len(body) > MAX_FORM_BYTES:
                        return PlainTextResponse("too long", status_code=413)
        except TimeoutError:
            return PlainTextResponse("too slow", status_code=408)
        if not self._may_try(_network_of(request)):
            return HTMLResponse(_form("Too many attempts. Wait a few seconds."), status_code=429)
        password = parse_qs(body.decode("utf-8", "replace")).get("password", [""])[0]
        if not hmac.compare_digest(password.encode(), self._password.encode()):
            return HTMLResponse(_form("Wrong password."), status_code=401)
        now_s = time.monotonic()
        self._sessions = {key: end_s for key, end_s in self._sessions.items() if end_s > now_s}
        session = secrets.token_urlsafe(32)
        self._sessions[session] = now_s + SESSION_S
        answer = RedirectResponse("/", status_code=303)
        answer.set_cookie(
            COOKIE, session, max_age=int(SESSION_S), httponly=True, samesite="strict", secure=self._secure
        )
        return answer


def _is_own_request(scope: Scope, headers: Headers) -> bool:
    """Return False for requests that a page of another site or port made; following a link is allowed."""
    site = headers.get("sec-fetch-site", "none")  # not every browser sends it
    is_link = (
        scope["type"] == "http" and scope["method"] == "GET" and headers.get("sec-fetch-mode") == "navigate"
    )
    return site in ("same-origin", "none") or (is_link and headers.get("sec-fetch-dest") == "document")


def _network_of(request: Request) -> str:
    """Return the client's address; of an IPv6 address the part that one computer cannot choose."""
    host = request.client.host if request.client else ""
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return host
    mapped = address.ipv4_mapped if address.version == 6 else None
    return address.exploded[:19] if address.version == 6 and mapped is None else str(mapped or address)


def _host_name(headers: Headers) -> str:
    """Return the name in the Host header without the port; empty if it is malformed."""
    try:
        return urlsplit(f"//{headers.get('host', '')}").hostname or ""
    except ValueError:
        return ""


def _session_of(headers: Headers) -> str:
    """Return the session's id in the cookie; empty without one."""
    try:
        cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        return ""
    return "" if cookie is None else cookie.value


async def _refuse(scope: Scope, receive: Receive, send: Send, response: Response) -> None:
    if scope["type"] == "websocket":
        await receive()  # websocket.connect
        await send({"type": "websocket.close", "code": 1008})
    else:
        await response(scope, receive, send)


def _form(problem: str) -> str:
    return f"""<!doctype html><html lang="en"><meta charset="utf-8"><title>Thumper</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; display: grid; place-items: center; min-height: 100vh;
  margin: 0; background: #0f1720; color: #e6edf3 }}
form {{ background: #18222d; padding: 2rem; border-radius: 12px; width: min(20rem, 80vw) }}
h1 {{ font-size: 1.25rem; margin: 0 0 1rem; display: flex; align-items: center; gap: .5rem }}
svg {{ width: 2rem }}
input, button {{ font: inherit; width: 100%; box-sizing: border-box; padding: .6rem .8rem; border-radius: 8px;
  border: 1px solid #3a4856; background: #0f1720; color: inherit; margin-top: .5rem }}
button {{ background: #1f6feb; border: 0; color: #fff; font-weight: 600; margin-top: 1rem }}
p {{ color: #ff9e94; min-height: 1.5em; margin: .75rem 0 0 }}
</style>
<form method="post" action="/login"><h1>{ICON}Thumper</h1>
<label>Password <input type="password" name="password" autofocus required></label>
<button>Log in</button><p role="alert">{escape(problem)}</p></form></html>"""
