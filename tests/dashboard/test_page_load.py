"""The page says at once that it loads, and its scripts are read and compressed only once."""

from collections.abc import Mapping
from typing import Any

import pytest
from benchmarks.shared.browser import Server
from playwright.sync_api import Browser, Page, expect

from thumper.dashboard.static_cache import StaticCache

SCRIPT = "/_nicegui/3.0/static/vue.js"


def test_it_says_that_it_loads_before_its_scripts_arrive(browser: Browser, server: Server) -> None:
    page = browser.new_page()
    page.route("**/*.js", lambda route: route.abort())
    page.goto(server.url)
    expect(page.locator("#tp-loading")).to_have_text("ThumperLoading the dashboard …")
    page.close()


def test_a_page_that_has_loaded_does_not_say_so(page: Page) -> None:
    expect(page.locator("#tp-loading")).to_have_count(0)


def test_a_broken_tool_does_not_leave_the_emergency_stop_covered(browser: Browser, server: Server) -> None:
    page = browser.new_page()
    broken = "export function addMapEditor() { throw new Error('broken'); } export function editMap() {}"
    page.route("**/map_editor.js", lambda route: route.fulfill(body=broken, content_type="text/javascript"))
    page.goto(server.url)
    expect(page.locator(".tp-estop")).to_be_visible()
    expect(page.locator("#tp-loading")).to_have_count(0)
    page.close()


class Files:
    """Stands for the web application: counts its requests and answers each in two parts."""

    def __init__(self, status: int = 200) -> None:
        self.status, self.requests = status, 0

    async def __call__(self, _scope: Any, _receive: Any, send: Any) -> None:
        self.requests += 1
        await send({"type": "http.response.start", "status": self.status, "headers": [(b"etag", b"1")]})
        await send({"type": "http.response.body", "body": b"let ", "more_body": True})
        await send({"type": "http.response.body", "body": b"x"})


def get(cache: StaticCache, path: str = SCRIPT, **headers: str) -> list[Mapping[str, Any]]:
    sent: list[Mapping[str, Any]] = []

    async def send(message: Any) -> None:
        sent.append(message)

    pairs = [(name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()]
    scope = {"type": "http", "method": "GET", "path": path, "headers": pairs}
    with pytest.raises(StopIteration):  # it waits for nothing, and the browser's tests have an event loop
        cache(scope, None, send).send(None)  # type: ignore[arg-type]
    return sent


def test_a_script_is_read_once_for_each_encoding() -> None:
    files = Files()
    cache = StaticCache(files)
    first = get(cache)
    assert get(cache) == first
    assert b"".join(message.get("body", b"") for message in first) == b"let x"
    assert files.requests == 1
    get(cache, accept_encoding="gzip, br")
    get(cache, accept_encoding="gzip")
    assert files.requests == 2


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        ("/", {}, 200),
        ("/_nicegui/3.0/dynamic_resources/x.css", {}, 200),
        (SCRIPT, {"if_none_match": "1"}, 200),
        (SCRIPT, {"range": "bytes=0-1"}, 200),
        (SCRIPT, {}, 404),
    ],
)
def test_nothing_else_is_kept(path: str, headers: dict[str, str], status: int) -> None:
    files = Files(status)
    cache = StaticCache(files)
    get(cache, path, **headers)
    get(cache, path, **headers)
    assert files.requests == 2
