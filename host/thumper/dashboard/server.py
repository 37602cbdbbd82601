"""The server's process: bus on one side, browsers on the other."""

import asyncio
import errno
import socket
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from fastapi import FastAPI, WebSocket
from nicegui import app as nicegui_app
from nicegui import ui
from starlette.middleware import Middleware

from thumper.dashboard.access import Access
from thumper.dashboard.helm import Helm, TeleopLimits
from thumper.dashboard.hub import Hub
from thumper.dashboard.options import Listening, is_loopback
from thumper.dashboard.page import PageOptions, build_page
from thumper.dashboard.page_parts import STATIC
from thumper.dashboard.robot_link import RobotLink
from thumper.dashboard.view import TOPICS, View
from thumper.errors import ThumperError
from thumper.geometry import Pose2

LARGEST_SOCKET_MESSAGE_BYTES = 64 * 1024


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
    robot: RobotLink, listening: Listening, page: PageOptions, limits: TeleopLimits, base_from_laser: Pose2
) -> FastAPI:
    """Wire the page to the bus."""
    recording = RecordingClock()

    def extra() -> dict[str, Any]:
        status = view.value("status") or {}
        return {
            "recording_s": recording.elapsed_s(bool(status.get("recording"))),
            "limits": {"v_m_s": limits.v_m_s, "w_rad_s": limits.w_rad_s, "slow": limits.slow},
        }

    view = View(base_from_laser)
    hub = Hub(view, Helm(robot, limits, lambda: view.map_from_base), extra)
    view.on_change = hub.on_change
    robot.start(view.take, TOPICS)
    hosts = frozenset({"localhost", "127.0.0.1", "::1"}) if is_loopback(listening.host) else frozenset()
    app = FastAPI(
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
        middleware=[Middleware(Access, hosts=hosts, password=listening.password, secure=listening.secure)],
    )

    @app.websocket("/stream")
    async def stream(socket: WebSocket) -> None:
        await hub.serve(socket)

    @ui.page("/", title=f"Thumper · {page.robot}", favicon=STATIC / "icon.svg")
    def index() -> None:
        build_page(page, robot)

    ticks: list[asyncio.Task[None]] = []

    async def begin() -> None:
        ticks.append(asyncio.create_task(hub.run()))

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


def serve(app: FastAPI, listening: Listening) -> None:
    """Serve until Ctrl-C.

    Raises
    ------
    ThumperError
        The port is taken, or the certificate cannot be used.
    """
    import uvicorn

    with _bound(listening) as listener:
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


def _bound(listening: Listening) -> socket.socket:
    family = socket.AF_INET6 if ":" in listening.host else socket.AF_INET
    listener = socket.socket(family)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((listening.host, listening.port))
    except (OSError, socket.gaierror) as error:
        listener.close()
        taken = isinstance(error, OSError) and error.errno == errno.EADDRINUSE
        why = "it is taken; choose another with --port" if taken else str(error.strerror)
        raise ThumperError(f"cannot listen on {listening.host}:{listening.port}: {why}") from error
    return listener


def _path(path: Path | None) -> str | None:
    return None if path is None else str(path)
