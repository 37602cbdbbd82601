"""Fixtures: a fake robot on a real bus, the real server process and a headless browser."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from benchmarks.shared.browser import CHROMIUM, FLAGS, Server, open_page
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import free_port
from playwright.sync_api import Browser, BrowserType, Page, expect, sync_playwright

from tests.dashboard.built_site import ROOT, build_pages, build_robot

expect.set_options(timeout=30_000)  # a machine that is busy with other tests takes its time


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


@pytest.fixture
def page(browser: Browser, server: Server, robot: FakeRobot) -> Iterator[Page]:
    """An open, connected page; a request to another host fails the test."""
    robot.reset()
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    page = context.new_page()
    outside: list[str] = []
    own = re.compile(rf"^(https?|wss?)://localhost:{server.port}/|^(blob|data):")
    page.on("request", lambda request: None if own.match(request.url) else outside.append(request.url))
    page.on("websocket", lambda socket: None if own.match(socket.url) else outside.append(socket.url))
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    open_page(page, server)
    yield page
    context.close()
    assert not outside
    assert not problems
