"""Start the page: in this process, or in its own process beside the robot."""

import errno
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.common.parent import parent_environment
from thumper.config.dashboard import ServerOptions, check_options
from thumper.dashboard.starting_page import starting_page


def bind_port(options: ServerOptions, option: str = "--port") -> socket.socket:
    """Bind the port; closing the socket releases it. `option` is the command's option for another port.

    Raises
    ------
    ThumperError
        The port is in use.
    """
    family = socket.AF_INET6 if ":" in options.host else socket.AF_INET
    listener = socket.socket(family)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((options.host, options.port))
        listener.listen()
    except (OSError, socket.gaierror) as error:
        listener.close()
        in_use = isinstance(error, OSError) and error.errno == errno.EADDRINUSE
        reason = (
            f"the port is in use; stop the program that uses it, or choose another port with {option}"
            if in_use
            else str(error.strerror)
        )
        raise ThumperError(
            f"cannot listen on {options.host}:{options.port}: {reason}", exit_code=EXIT_NOT_THERE
        ) from error
    return listener


if TYPE_CHECKING:
    from fastapi import FastAPI

    from thumper.config.robot import RobotConfig
    from thumper.dashboard.guide.guide import Guide

END_TIMEOUT_S = 3.0
ANSWER_TIMEOUT_S = 2.0
MIN_RESTART_S, MAX_RESTART_S = 1.0, 30.0  # before a page that has ended starts again
STABLE_S = 60.0  # a page that ran this long starts again without further delay


GUIDED_V_MAX_M_S = 0.4  # with turbo; half of it without


def run_dashboard(
    settings: "RobotConfig", options: ServerOptions, robot_address: str, *, guide: "Guide | None" = None
) -> None:
    """Serve until Ctrl-C, or until its parent ends (`end_with_parent`).

    `guide` is the state of the page `/setup`, which guides through the first run.
    """
    listener = bind_port(options)  # before the slow imports, to report a port in use at once
    with nullcontext() if options.secure else starting_page(listener):
        app = _build(settings, options, robot_address, guide)
    page = "first run" if guide is not None else "dashboard"
    url = f"{options.url}setup" if guide is not None else options.url
    print(f"{page}: {url}  (robot at {robot_address}; press Ctrl-C to stop)", flush=True)
    from thumper.dashboard.server import serve

    serve(app, options, listener)


def _build(
    settings: "RobotConfig", options: ServerOptions, robot_address: str, guide: "Guide | None"
) -> "FastAPI":
    from thumper.bus.client import BusClient
    from thumper.dashboard.page import PageOptions
    from thumper.dashboard.page_commands import TeleopLimits
    from thumper.dashboard.server import build_app

    service = settings.service
    v_max_m_s = service.manual_v_max_m_s
    if guide is not None:
        v_max_m_s = min(v_max_m_s, GUIDED_V_MAX_M_S)
    return build_app(
        BusClient(settings.name, robot_address, settings.bus.token, tls=settings.bus.tls, wait=True),
        options,
        PageOptions(
            robot=settings.name,
            address=robot_address,
            footprint_m=list(settings.footprint.vertices_m),
            has_password=bool(options.password),
            library=Path(settings.recording.folder),
        ),
        TeleopLimits(v_m_s=v_max_m_s, w_rad_s=service.manual_w_max_rad_s),
        settings.lidar.base_from_laser,
        guide,
    )


class PageProcess:
    """Runs the page beside the robot. It starts again if it ends by itself, and ends with this process.

    The page's process holds the reading end of a pipe. If this process ends in whatever way, the pipe closes
    and the page ends.
    """

    def __init__(self, command: list[str], report: Callable[[str], None]) -> None:
        """`report` receives a line when the page has ended; it is called from another thread."""
        self._command, self._report = command, report
        self._closed = threading.Event()
        self._process = self._start()
        self._thread = threading.Thread(target=self._watch, name="page-process", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the page."""
        self._closed.set()
        while self._thread.is_alive():  # again, if the thread has just started a new one
            self._process.terminate()
            self._thread.join(END_TIMEOUT_S)
            if self._thread.is_alive():
                self._process.kill()

    def _start(self) -> "subprocess.Popen[bytes]":
        return subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,  # its address, which this process prints
            env=os.environ | parent_environment(END_TIMEOUT_S),
            start_new_session=True,  # Ctrl-C goes to the robot first
        )

    def _watch(self) -> None:
        delay_s = MIN_RESTART_S
        while True:
            started_s = time.monotonic()
            status = self._process.wait()
            if self._process.stdin:
                self._process.stdin.close()
            if time.monotonic() - started_s > STABLE_S:
                delay_s = MIN_RESTART_S
            if not self._closed.is_set():
                how = f"signal {-status}" if status < 0 else f"exit status {status}"
                self._report(f"the dashboard has ended ({how}); it starts again in {delay_s:g} s")
            if self._closed.wait(delay_s):
                return
            delay_s = min(2.0 * delay_s, MAX_RESTART_S)
            self._process = self._start()


def open_pages(url: str) -> int | None:
    """Return how many browsers show the page at `url`; None if its server does not answer.

    Works for a page on this computer without a password.
    """
    from urllib.request import urlopen

    try:
        with urlopen(f"{url}pages", timeout=ANSWER_TIMEOUT_S) as answer:
            return int(answer.read())
    except OSError:
        return None


def _print_line(text: str) -> None:
    print(f"thumper: {text}", file=sys.stderr, flush=True)


@contextmanager
def dashboard_process(
    config: Path | None, robot_address: str, *, wanted: bool = True, port: int = 0
) -> Iterator[str]:
    """Run the page in its own process, if `wanted`, while the robot runs in this one; yield its address.

    `port` is that of the page; 0 for the configured one. The page needs seconds to start, so the caller
    prints the address once the robot runs.

    Raises
    ------
    ThumperError
        The page cannot start: its port or the bus's is in use, or its options are wrong.
    ModuleNotFoundError
        The page is not installed.
    """
    if not wanted:
        yield ""
        return
    from thumper.bus.zenoh_session import check_address_free
    from thumper.config.robot import load_config

    if find_spec("nicegui") is None:
        raise ModuleNotFoundError(name="nicegui")
    options = load_config(config).dashboard
    listening = check_options(replace(options, port=port or options.port))
    bind_port(listening, "--ui-port").close()
    check_address_free(robot_address)  # else the page would show another robot
    command = [sys.executable, "-m", "thumper", "dashboard", "--bus", robot_address]
    if config is not None:
        command += ["--config", str(config)]
    if port:
        command += ["--port", str(port)]
    process = PageProcess(command, _print_line)
    try:
        yield listening.url
    finally:
        process.close()
