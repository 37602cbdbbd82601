"""The server's process: bus on one side, browsers on the other."""

import asyncio
import socket
import time
from contextlib import suppress
from html import escape
from pathlib import Path
from typing import Any

from fastapi import FastAPI, WebSocket
from fastapi.responses import HTMLResponse
from nicegui import app as nicegui_app
from nicegui import ui
from starlette.middleware import Middleware

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.config.bus import is_loopback
from thumper.config.dashboard import Listening
from thumper.dashboard.bus_link import BusLink
from thumper.dashboard.certificate import server_tls
from thumper.dashboard.connections import Connections
from thumper.dashboard.login import AccessControl
from thumper.dashboard.page import PageOptions, build_page
from thumper.dashboard.page_commands import PageCommands, TeleopLimits
from thumper.dashboard.page_state import TOPICS, PageState
from thumper.dashboard.widgets import STATIC

EXPERIMENT_PERIOD_S = 0.5
REPORT_POLICY = "sandbox; default-src 'none'; img-src data:; style-src 'unsafe-inline'"
LARGEST_SOCKET_MESSAGE_BYTES = 64 * 1024


class ExperimentWatch:
    """How far the robot's experiment is: asked for once for all pages."""

    def __init__(self, robot: BusLink) -> None:
        self._robot = robot
        self.state: dict[str, Any] | None = None  # None: the robot cannot tell

    async def run(self) -> None:
        """Ask until cancelled."""
        while True:
            try:
                answer = await asyncio.to_thread(self._robot.query, "experiment/state", {})
                self.state = {name: value for name, value in answer.items() if name != "ok"}
            except ThumperError:
                self.state = None
            await asyncio.sleep(EXPERIMENT_PERIOD_S)


class RecordingClock:
    """How long the recording runs; the robot tells only that it runs."""

    def __init__(self) -> None:
        self._since_s: float | None = None

    def elapsed_s(self, recording: bool) -> int | None:
        """Seconds since the recording was first seen to run; None when there is none."""
        if not recording:
            self._since_s = None
            return None
        if self._since_s is None:
            self._since_s = time.monotonic()
        return int(time.monotonic() - self._since_s)


def build_app(
    robot: BusLink, listening: Listening, page: PageOptions, limits: TeleopLimits, base_from_laser: Pose2
) -> FastAPI:
    """Wire the page to the bus."""
    recording = RecordingClock()
    experiment = ExperimentWatch(robot)

    def extra() -> dict[str, Any]:
        status = view.value("status") or {}
        return {
            "experiment": experiment.state,
            "recording_s": recording.elapsed_s(bool(status.get("recording"))),
            "limits": {"v_m_s": limits.v_m_s, "w_rad_s": limits.w_rad_s, "slow": limits.slow},
        }

    view = PageState(base_from_laser)
    hub = Connections(view, PageCommands(robot, limits, lambda: view.map_from_base), extra)
    view.on_change = hub.on_change
    robot.start(view.take, TOPICS)
    hosts = frozenset({"localhost", "127.0.0.1", "::1"}) if is_loopback(listening.host) else frozenset()
    app = FastAPI(
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
        middleware=[
            Middleware(AccessControl, hosts=hosts, password=listening.password, secure=listening.secure)
        ],
    )

    @app.websocket("/stream")
    async def stream(socket: WebSocket) -> None:
        await hub.serve(socket)

    @app.get("/report")
    def report() -> HTMLResponse:
        try:
            html = str(robot.query("experiment/report", {})["html"])
        except ThumperError as error:
            return HTMLResponse(escape(str(error)), status_code=404)
        # From the robot's files: shown, and kept from doing anything.
        return HTMLResponse(html, headers={"Content-Security-Policy": REPORT_POLICY})

    @ui.page("/", title=f"Thumper · {page.robot}", favicon=STATIC / "icon.svg")
    def index() -> None:
        build_page(page, robot)

    ticks: list[asyncio.Task[None]] = []

    async def begin() -> None:
        ticks.append(asyncio.create_task(hub.run()))
        ticks.append(asyncio.create_task(experiment.run()))

    def end() -> None:
        for task in ticks:
            task.cancel()
        robot.close()

    nicegui_app.on_startup(begin)
    nicegui_app.on_shutdown(end)
    ui.run_with(
        app,
        title="Thumper",
        reconnect_timeout=10.0,
        show_welcome_message=False,
        tailwind=False,
        language="en-US",
    )
    return app


def serve(app: FastAPI, listening: Listening, listener: socket.socket) -> None:
    """Serve until Ctrl-C.

    Raises
    ------
    ThumperError
        The certificate cannot be used.
    """
    import uvicorn

    if listening.certificate and listening.key:
        server_tls(listening.certificate, listening.key)  # says in one line what is wrong with them
    with listener:
        config = uvicorn.Config(
            app,
            log_level="warning",
            ws_max_size=LARGEST_SOCKET_MESSAGE_BYTES,
            ws_per_message_deflate=False,  # scans hardly shrink, and packing them costs time
            ssl_certfile=_path(listening.certificate),
            ssl_keyfile=_path(listening.key),
            timeout_graceful_shutdown=1,
        )
        with suppress(KeyboardInterrupt):
            uvicorn.Server(config).run(sockets=[listener])


def _path(path: Path | None) -> str | None:
    return None if path is None else str(path)
