"""The web server between the bus and the browsers."""

import asyncio
import socket
import time
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from fastapi.responses import HTMLResponse, RedirectResponse
from nicegui import app as nicegui_app
from nicegui import ui
from starlette.middleware import Middleware

from thumper.bus.client import BusClient
from thumper.bus.map_feed import MapFeed
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.config.bus import is_loopback
from thumper.config.dashboard import ServerOptions
from thumper.dashboard.certificate import server_tls
from thumper.dashboard.connections import Connections, add_stream
from thumper.dashboard.guide.guide import Guide
from thumper.dashboard.guide.guide_page import add_guide
from thumper.dashboard.library import add_library
from thumper.dashboard.login import AccessControl
from thumper.dashboard.map_edits import add_map_edits
from thumper.dashboard.page import PageOptions, build_page, page_title
from thumper.dashboard.page_commands import PageCommands, TeleopLimits
from thumper.dashboard.page_state import TOPICS, PageState
from thumper.dashboard.playback import add_playback
from thumper.dashboard.server_limits import TimedProtocol, drop_abandoned_pages, limit_log, raise_file_limit
from thumper.dashboard.static_cache import StaticCache
from thumper.dashboard.widgets import STATIC
from thumper.ros import services

EXPERIMENT_PERIOD_S = 0.5
REPORT_POLICY = "sandbox; default-src 'none'; img-src data:; style-src 'unsafe-inline'"
MAX_SOCKET_MESSAGE_BYTES = 64 * 1024


class ExperimentWatch:
    """Polls the state of the robot's experiment, once for all pages."""

    def __init__(self, robot: BusClient) -> None:
        self._robot = robot
        self.state: dict[str, Any] | None = None  # None: the robot does not answer

    async def run(self) -> None:
        """Poll until cancelled."""
        while True:
            try:
                reply = await asyncio.to_thread(services.EXPERIMENT_STATE.call, self._robot)
                self.state = asdict(reply)
            except ThumperError:
                self.state = None
            await asyncio.sleep(EXPERIMENT_PERIOD_S)


class RecordingClock:
    """Measures how long the recording has been running; the robot reports only that it is."""

    def __init__(self) -> None:
        self._since_s: float | None = None

    def elapsed_s(self, recording: bool) -> int | None:
        """Return the seconds since the recording was first seen to run; None if there is none."""
        if not recording:
            self._since_s = None
            return None
        if self._since_s is None:
            self._since_s = time.monotonic()
        return int(time.monotonic() - self._since_s)


def build_app(
    robot: BusClient,
    options: ServerOptions,
    page: PageOptions,
    limits: TeleopLimits,
    base_from_laser: Pose2,
    guide: Guide | None = None,
) -> FastAPI:
    """Build the web application: connect the pages to the bus. `guide` adds the page of the first run."""
    recording = RecordingClock()
    experiment = ExperimentWatch(robot)

    def extra() -> dict[str, Any]:
        status = state.value("status") or {}
        return {
            "experiment": experiment.state,
            "recording_s": recording.elapsed_s(bool(status.get("recording"))),
            "limits": {"v_m_s": limits.v_m_s, "w_rad_s": limits.w_rad_s, "slow": limits.slow},
            "first_run": guide.progress if guide is not None else "",
        }

    state = PageState(base_from_laser)
    commands = PageCommands(robot, limits, lambda: state.map_from_base)
    connections = Connections(state, commands, extra)
    state.on_change = connections.on_change
    for topic in TOPICS:
        if topic != "map":
            robot.subscribe(topic, partial(state.on_message, topic))
    MapFeed(robot, state.on_message)
    hosts = frozenset({"localhost", "127.0.0.1", "::1"}) if is_loopback(options.host) else frozenset()
    app = FastAPI(
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
        middleware=[
            Middleware(AccessControl, hosts=hosts, password=options.password, secure=options.secure),
            Middleware(StaticCache),
        ],
    )

    add_stream(app, connections)

    @app.get("/report")
    def report() -> HTMLResponse:
        try:
            html = services.EXPERIMENT_REPORT.call(robot).html
        except ThumperError as error:
            return HTMLResponse(escape(str(error)), status_code=404)
        # The report comes from the robot's files: sandbox it.
        return HTMLResponse(html, headers={"Content-Security-Policy": REPORT_POLICY})

    add_library(app, robot, page.library)
    add_playback(app, page.library)
    add_map_edits(app, page.library)

    @ui.page("/", title=page_title(page.robot), favicon=STATIC / "icon.svg")
    def index() -> RedirectResponse | None:
        if guide is not None and not guide.has_robot:
            return RedirectResponse("/setup")  # a dashboard without a robot helps nobody
        build_page(page, robot, lambda: (state.value("board") or {}).get("state", ""))
        drop_abandoned_pages()
        return None

    if guide is not None:
        add_guide(guide, robot, page, commands)

    ticks: list[asyncio.Task[None]] = []

    async def start() -> None:
        ticks.append(asyncio.create_task(connections.run()))
        ticks.append(asyncio.create_task(experiment.run()))

    def stop() -> None:
        for task in ticks:
            task.cancel()
        robot.close()

    nicegui_app.on_startup(start)
    nicegui_app.on_shutdown(stop)
    ui.run_with(
        app,
        title="Thumper",
        reconnect_timeout=10.0,
        show_welcome_message=False,
        tailwind=False,
        language="en-US",
    )
    return app


def serve(app: FastAPI, options: ServerOptions, listener: socket.socket) -> None:
    """Serve until Ctrl-C.

    Raises
    ------
    ThumperError
        The certificate cannot be used.
    """
    import uvicorn

    if options.certificate and options.key:
        server_tls(options.certificate, options.key)  # reports in one line what is wrong with them
    with listener:
        raise_file_limit()
        limit_log()
        config = uvicorn.Config(
            app,
            http=TimedProtocol,
            log_config=None,
            log_level="warning",
            ws_max_size=MAX_SOCKET_MESSAGE_BYTES,
            ws_per_message_deflate=False,  # scans hardly compress, and compressing costs time
            ssl_certfile=_text(options.certificate),
            ssl_keyfile=_text(options.key),
            timeout_graceful_shutdown=1,
        )
        with suppress(KeyboardInterrupt):
            uvicorn.Server(config).run(sockets=[listener])


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)
