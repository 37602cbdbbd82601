"""Fixtures: a fake robot on a real bus, the real server process and a headless browser."""

import re
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

import pytest
from benchmarks.shared.browser import CHROMIUM, FLAGS, Server, open_page
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import free_port
from playwright.sync_api import Browser, BrowserType, Page, expect, sync_playwright

from tests.dashboard.built_site import ROOT, build_pages, build_robot
from tests.page_checks import DESK

expect.set_options(timeout=30_000)  # a machine that is busy with other tests takes its time

HAS_FAILED = pytest.StashKey[bool]()


@pytest.fixture(scope="package")
def robot() -> Iterator[FakeRobot]:
    robot = FakeRobot(address=f"127.0.0.1:{free_port()}")
    yield robot
    robot.close()


@pytest.fixture(scope="package")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of maps and recordings that the server reads."""
    return tmp_path_factory.mktemp("library")


@pytest.fixture(scope="package")
def server(robot: FakeRobot, library: Path) -> Iterator[Server]:
    config = library.parent / "robot.toml"
    config.write_text(f'[recording]\nfolder = "{library}"\n', encoding="utf-8")
    server = Server(robot.address, library.parent, "--config", str(config))
    yield server
    server.close()


@pytest.fixture(scope="package")
def chromium() -> Iterator[BrowserType]:
    if not Path(CHROMIUM).exists():
        pytest.skip(f"{CHROMIUM} is not there; `make test` installs it")
    with sync_playwright() as playwright:
        yield playwright.chromium


@pytest.fixture(scope="package")
def browser(chromium: BrowserType) -> Iterator[Browser]:
    browser = chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
    yield browser
    browser.close()


@pytest.fixture(scope="package")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the documentation's site, without the robot on its front page."""
    return build_pages(tmp_path_factory.mktemp("site"))


@pytest.fixture(scope="package")
def site(pages: Path) -> Path:
    """Return the folder of the whole site."""
    if not (ROOT / "hil/browser/node_modules/.bin/esbuild").exists():
        pytest.skip("esbuild is not installed; `make docs` installs it")
    done = build_robot(pages)
    assert done.returncode == 0, done.stderr
    return pages


class Tab:
    """The tab of all tests of the page: to load the page takes 1.4 s of CPU in it, 2.2 s in a new one."""

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        self._page: Page | None = None

    @property
    def page(self) -> Page:
        """The tab, as wide as a screen; a new one after `close`."""
        self._page = self._page or self._browser.new_page(viewport=DESK)
        return self._page

    def clear(self) -> None:
        """Leave the page, and undo what a test may have changed in the tab."""
        page = self.page
        page.context.set_offline(False)
        page.evaluate("localStorage.clear(), sessionStorage.clear()")
        page.goto("about:blank")
        page.context.clear_cookies()
        page.unroute_all()
        page.emulate_media(color_scheme="null")
        page.set_viewport_size(DESK)

    def close(self) -> None:
        """Close the tab, in which a failed test may have left anything, such as a key that is down."""
        if self._page:
            self._page.close()
        self._page = None


@pytest.fixture(scope="package")
def tab(browser: Browser) -> Iterator[Tab]:
    tab = Tab(browser)
    yield tab
    tab.close()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if report.failed:
        item.stash[HAS_FAILED] = True
    return report


@pytest.fixture
def page(tab: Tab, server: Server, robot: FakeRobot, request: pytest.FixtureRequest) -> Iterator[Page]:
    """An open, connected page; a request to another host fails the test."""
    robot.reset()
    page = tab.page
    outside: list[str] = []
    own = re.compile(rf"^(https?|wss?)://localhost:{server.port}/|^(blob|data):")
    problems: list[str] = []
    handlers: dict[Any, Callable[[Any], None]] = {
        "request": lambda one: None if own.match(one.url) else outside.append(one.url),
        "websocket": lambda socket: None if own.match(socket.url) else outside.append(socket.url),
        "pageerror": lambda error: problems.append(str(error)),
    }
    for event, handler in handlers.items():
        page.on(event, handler)
    open_page(page, server)
    yield page
    if request.node.stash.get(HAS_FAILED, False):
        tab.close()
    else:
        tab.clear()
        for event, handler in handlers.items():
            page.remove_listener(event, handler)
    assert not outside
    assert not problems
