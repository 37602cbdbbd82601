"""Access control, message by message and without a server: who is let in, and what an answer carries."""

import asyncio
from collections.abc import Coroutine
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlencode

import pytest

from thumper.dashboard.login import COOKIE, MAX_NETWORKS, SESSION_S, AccessControl
from thumper.dashboard.rate_limit import RateLimit

PASSWORD = "correct horse"
LOCAL = frozenset({"localhost", "127.0.0.1"})
HOST = [(b"host", b"localhost:8080")]
Scope = dict[str, Any]


def run(call: Coroutine[Any, Any, None]) -> None:
    """Run the call in a thread: the browser tests of this process may have left an event loop running."""
    with ThreadPoolExecutor(1) as thread:
        thread.submit(asyncio.run, call).result()


class Site:
    """An application behind the access control, and the messages that it and a client exchange."""

    def __init__(
        self, *, password: str = PASSWORD, secure: bool = False, hosts: frozenset[str] = LOCAL
    ) -> None:
        self.access = AccessControl(self._app, hosts=hosts, password=password, secure=secure)
        self.address = "127.0.0.1"
        self.reached: list[str] = []
        self.received: list[Any] = []

    async def _app(self, scope: Any, receive: Any, send: Any) -> None:
        self.reached.append(scope["type"])
        if scope["type"] == "http":
            await send({"type": "http.response.start", "status": 200, "headers": []})
            await send({"type": "http.response.body", "body": b"the page"})
        elif scope["type"] == "websocket":
            for _ in range(2):
                self.received.append(await receive())

    def request(
        self, path: str = "/", method: str = "GET", body: bytes = b"", kind: str = "http", **headers: str
    ) -> tuple[int, dict[str, str]]:
        """Send a request; return status and headers. A websocket that is refused has status 1008."""
        given = {"host": "localhost:8080"} | {
            name.replace("_", "-"): value for name, value in headers.items()
        }
        scope = {
            "type": kind,
            "path": path,
            "method": method,
            "query_string": b"",
            "client": (self.address, 40_000),
            "headers": [(name.encode(), value.encode()) for name, value in given.items()],
        }
        sent: list[Any] = []

        async def receive() -> Any:
            if kind == "websocket":
                return {"type": "websocket.receive", "text": "hello"}
            return {"type": "http.request", "body": body, "more_body": False}

        async def send(message: Any) -> None:
            sent.append(message)

        run(self.access(scope, receive, send))
        start = sent[0] if sent else {}
        answer = {name.decode(): value.decode() for name, value in start.get("headers", [])}
        return start.get("status", start.get("code", 0)), answer

    def log_in(self, password: str = PASSWORD) -> tuple[int, str]:
        """Return the status and the cookie."""
        body = urlencode({"password": password}).encode()
        status, headers = self.request("/login", "POST", body)
        return status, headers.get("set-cookie", "").partition(";")[0]


def test_without_a_password_the_page_is_open() -> None:
    site = Site(password="")
    assert site.request()[0] == 200
    assert site.request("/login")[0] == 200  # a page of the application, not the form
    assert site.request("/logout", "POST")[0] == 200
    assert site.reached == ["http"] * 3


def test_with_a_password_nothing_is_reached_before_the_login() -> None:
    site = Site()
    assert site.request()[0] == 401
    assert site.request(accept="text/html")[0] == 303
    assert site.request("/stream", kind="websocket")[0] == 1008
    assert site.request("/_nicegui/anything")[0] == 401
    assert site.request("/report", "POST")[0] == 401
    assert site.request("/logout", "POST")[0] == 401
    assert site.request("/login")[0] == 200  # the form
    assert not site.reached


@pytest.mark.parametrize(
    "cookie",
    ["", COOKIE, f"{COOKIE}=", f"{COOKIE}=anything", f"{COOKIE}=None", "other=1", f'{COOKIE}="', "\x00=;;"],
)
def test_no_made_up_cookie_is_logged_in(cookie: str) -> None:
    site = Site()
    _, good = site.log_in()
    assert site.request(cookie=cookie)[0] == 401
    assert site.request(cookie=good + "x")[0] == 401
    assert site.request(cookie=good[:-1])[0] == 401
    assert site.request("/stream", kind="websocket", cookie=cookie)[0] == 1008
    assert not site.reached
    assert site.request(cookie=good)[0] == 200
    assert site.request("/stream", kind="websocket", cookie=f"a=b; {good}")[0] == 0
    assert [message["type"] for message in site.received] == ["websocket.receive"] * 2


@pytest.mark.parametrize("password", ["", "correct", PASSWORD + " ", PASSWORD.upper(), "\u00e9", "x" * 1900])
def test_wrong_password_gets_no_session(password: str) -> None:
    status, cookie = Site().log_in(password)
    assert (status, cookie) == (401, "")


def test_form_without_a_password_field_or_too_long_is_refused() -> None:
    site = Site()
    assert site.request("/login", "POST", b"other=1")[0] == 401
    assert site.request("/login", "POST", b"\xff\xfe")[0] == 401
    assert site.request("/login", "POST", b"x" * 2048)[0] == 401
    assert site.request("/login", "POST", b"x" * 2049)[0] == 413
    assert site.request("/login", "PUT", urlencode({"password": PASSWORD}).encode())[0] == 200  # the form


def test_guesses_are_limited_and_the_limit_passes(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [1000.0]
    limit = partial(RateLimit, clock=lambda: now_s[0])
    monkeypatch.setattr("thumper.dashboard.login.RateLimit", limit)
    site = Site()
    assert [site.log_in("wrong")[0] for _ in range(7)] == [401] * 5 + [429] * 2
    assert site.log_in()[0] == 429  # the right one, too
    now_s[0] += 4.9
    assert site.log_in()[0] == 429
    now_s[0] += 0.2
    assert site.log_in()[0] == 303


@pytest.mark.parametrize(
    ("guesser", "operator"),
    [
        ("192.168.0.7", "192.168.0.8"),
        ("::ffff:192.168.0.7", "::ffff:192.168.0.8"),
        ("fe80::7%eth0", "2001:db8::7"),
    ],
)
def test_guesses_lock_out_nobody_at_another_address(guesser: str, operator: str) -> None:
    site = Site()
    site.address = guesser
    assert [site.log_in("wrong")[0] for _ in range(6)] == [401] * 5 + [429]
    site.address = operator
    assert site.log_in()[0] == 303
    site.address = guesser
    assert site.log_in()[0] == 429


@pytest.mark.parametrize(
    "addresses",
    [
        [f"2001:db8::{number}" for number in range(1, 7)],  # one computer may take any of them
        ["192.168.0.7", "::ffff:192.168.0.7"] * 3,
        ["a proxy's"] * 6,
    ],
)
def test_one_computer_has_one_limit_for_all_its_addresses(addresses: list[str]) -> None:
    site = Site()
    answers = []
    for site.address in addresses:
        answers.append(site.log_in("wrong")[0])
    assert answers == [401] * 5 + [429]


def test_the_addresses_that_guessed_do_not_fill_the_memory() -> None:
    site = Site()
    for number in range(MAX_NETWORKS + 1):
        assert site.access._may_try(f"network {number}")
        site.access._may_try("network 0")
    assert len(site.access._attempts) == MAX_NETWORKS
    assert not site.access._may_try("network 0")  # the newest are kept
    assert [site.access._may_try("network 1") for _ in range(6)] == [True] * 5 + [False]  # the oldest are not


def test_session_ends_after_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [1000.0]
    monkeypatch.setattr("thumper.dashboard.login.time.monotonic", lambda: now_s[0])
    site = Site()
    _, cookie = site.log_in()
    now_s[0] += SESSION_S - 1.0
    assert site.request(cookie=cookie)[0] == 200
    _, other = site.log_in()
    now_s[0] += 2.0
    assert site.request(cookie=cookie)[0] == 401
    assert site.request(cookie=other)[0] == 200
    assert SESSION_S == 12 * 3600.0


def test_logout_ends_the_session_and_its_websockets() -> None:
    site = Site()
    _, cookie = site.log_in()
    _, other = site.log_in()
    assert site.request("/logout", cookie=cookie)[0] == 405  # a link cannot log anybody out
    assert site.request(cookie=cookie)[0] == 200
    status, headers = site.request("/logout", "POST", cookie=cookie)
    assert (status, headers["location"]) == (303, "/login")
    assert 'thumper_session=""' in headers["set-cookie"]
    assert site.request(cookie=cookie)[0] == 401
    assert site.request(cookie=other)[0] == 200

    received: list[Any] = []

    async def app(_scope: Any, receive: Any, _send: Any) -> None:
        received.append(await receive())
        site.access._sessions.clear()
        received.append(await receive())

    site.access._app = app
    site.request("/stream", kind="websocket", cookie=other)
    assert [message["type"] for message in received] == ["websocket.receive", "websocket.disconnect"]


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(
    ("headers", "allowed"),
    [
        ({}, True),
        ({"host": "127.0.0.1:8080"}, True),
        ({"host": "evil.example"}, False),  # DNS rebinding
        ({"host": "localhost.evil.example"}, False),
        ({"host": ""}, False),
        ({"host": "["}, False),
        ({"origin": "http://localhost:8080"}, True),
        ({"origin": "http://localhost:3000"}, False),  # another program on this computer
        ({"origin": "http://evil.example"}, False),
        ({"origin": "null"}, False),
        ({"origin": "http://["}, False),
        ({"sec_fetch_site": "same-origin"}, True),
        ({"sec_fetch_site": "none"}, True),
        ({"sec_fetch_site": "same-site"}, False),  # another port
        ({"sec_fetch_site": "cross-site"}, False),
        ({"sec_fetch_site": "cross-site", "sec_fetch_mode": "navigate"}, False),  # in a frame
        ({"sec_fetch_site": "cross-site", "sec_fetch_dest": "document"}, False),
    ],
)
def test_only_the_page_itself_may_connect(kind: str, headers: dict[str, Any], *, allowed: bool) -> None:
    site = Site(password="")
    status, _ = site.request(kind=kind, **headers)
    assert (site.reached == [kind]) is allowed
    if not allowed:
        assert status == (403 if kind == "http" else 1008)


def test_links_from_other_sites_open_the_page() -> None:
    site = Site(password="")
    link: dict[str, Any] = {
        "sec_fetch_site": "cross-site",
        "sec_fetch_mode": "navigate",
        "sec_fetch_dest": "document",
    }
    assert site.request(**link)[0] == 200
    assert site.request(method="POST", **link)[0] == 403
    assert site.request(kind="websocket", **link)[0] == 1008


def test_public_page_accepts_any_host_name() -> None:
    site = Site(password="", hosts=frozenset())
    assert site.request(host="robot.local:8080")[0] == 200
    assert site.request(host="robot.local:8080", origin="http://evil.example")[0] == 403


def test_answers_carry_the_policy_even_refusals() -> None:
    for site in (Site(), Site(password="")):
        for host in ("localhost:8080", "evil.example"):
            _, answer = site.request(host=host)
            assert "default-src 'self'" in answer["content-security-policy"]
            assert answer["x-content-type-options"] == "nosniff"
            assert answer["referrer-policy"] == "same-origin"
            assert "strict-transport-security" not in answer


def test_https_page_asks_for_https_from_then_on() -> None:
    site = Site(secure=True, hosts=frozenset())
    _, answer = site.request(host="robot.local")
    assert answer["strict-transport-security"] == "max-age=31536000"
    _, answer = site.request(host="localhost:8080")  # would bind every program on this computer
    assert "strict-transport-security" not in answer


@pytest.mark.parametrize("secure", [True, False])
def test_cookie_is_out_of_reach_of_scripts_and_other_sites(*, secure: bool) -> None:
    site = Site(secure=secure)
    _, headers = site.request("/login", "POST", urlencode({"password": PASSWORD}).encode())
    parts = {part.strip().lower() for part in headers["set-cookie"].split(";")[1:]}
    assert {"httponly", "samesite=strict", "path=/", f"max-age={12 * 3600}"} <= parts
    assert ("secure" in parts) is secure
    assert headers["location"] == "/"


def test_lifespan_passes() -> None:
    site = Site()
    site.request(kind="lifespan")
    assert site.reached == ["lifespan"]


def test_form_that_never_arrives_is_answered_after_ten_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    waits_s = list[float]()

    def timeout(seconds: float) -> Any:
        waits_s.append(seconds)
        return asyncio.timeouts.timeout(0.01)

    monkeypatch.setattr("thumper.dashboard.login.asyncio", SimpleNamespace(timeout=timeout))
    site, sent = Site(), list[Any]()
    scope = {"type": "http", "path": "/login", "method": "POST", "query_string": b"", "headers": HOST}

    async def receive() -> Any:
        await asyncio.sleep(60.0)

    async def send(message: Any) -> None:
        sent.append(message)

    run(site.access(scope, receive, send))
    assert (sent[0]["status"], waits_s) == (408, [10.0])


def test_websocket_that_ends_with_its_session_says_why() -> None:
    site, received = Site(), list[Any]()
    _, cookie = site.log_in()

    async def app(_scope: Any, receive: Any, _send: Any) -> None:
        site.access._sessions.clear()
        received.append(await receive())

    site.access._app = app
    site.request("/stream", kind="websocket", cookie=cookie)
    assert received == [{"type": "websocket.disconnect", "code": 1008}]


def test_other_kinds_of_scope_and_websocket_paths_are_not_the_form() -> None:
    site = Site()
    assert site.request("/login", kind="websocket")[0] == 1008
    _, cookie = site.log_in()
    assert site.request("/logout", "POST", kind="websocket", cookie=cookie)[0] == 0
    assert site.request(cookie=cookie)[0] == 200  # still logged in
    for _ in range(3):
        site.log_in()
    assert len(site.access._sessions) == 4


def test_ended_sessions_are_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [1000.0]
    monkeypatch.setattr("thumper.dashboard.login.time.monotonic", lambda: now_s[0])
    site = Site()
    site.log_in()
    now_s[0] += SESSION_S  # to the second: it is over
    assert site.log_in()[0] == 303
    assert len(site.access._sessions) == 1
    key = next(iter(site.access._sessions))
    assert len(key) == 43  # 32 random bytes


def test_session_is_over_at_its_very_end(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [1000.0]
    monkeypatch.setattr("thumper.dashboard.login.time.monotonic", lambda: now_s[0])
    site = Site()
    _, cookie = site.log_in()
    now_s[0] += SESSION_S
    assert site.request(cookie=cookie)[0] == 401
    now_s[0] = 0.5  # a computer that has just started
    assert site.request(cookie="thumper_session=unknown")[0] == 401
