"""Start the page: in this process, or in its own process beside the robot."""

import errno
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from thumper.common.errors import ThumperError
from thumper.config.dashboard import ServerOptions, check_options


def bind_port(options: ServerOptions) -> socket.socket:
    """Bind the port; closing the socket releases it.

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
        listener.listen()  # a browser that connects during the slow start waits
    except (OSError, socket.gaierror) as error:
        listener.close()
        in_use = isinstance(error, OSError) and error.errno == errno.EADDRINUSE
        reason = (
            "the port is in use; stop the program that uses it, or choose another port: [dashboard] port in "
            "the configuration, or --port of `thumper dashboard`, which serves the page of a running robot"
            if in_use
            else str(error.strerror)
        )
        raise ThumperError(f"cannot listen on {options.host}:{options.port}: {reason}") from error
    return listener


if TYPE_CHECKING:
    from thumper.config.robot import RobotConfig

END_TIMEOUT_S = 3.0


def run_dashboard(settings: "RobotConfig", options: ServerOptions, robot_address: str) -> None:
    """Serve until Ctrl-C."""
    listener = bind_port(options)  # before the slow imports, to report a port in use at once
    from thumper.bus.client import BusClient
    from thumper.dashboard.page import PageOptions
    from thumper.dashboard.page_commands import TeleopLimits
    from thumper.dashboard.server import build_app, serve

    service = settings.service
    app = build_app(
        BusClient(settings.name, robot_address, settings.bus.token, tls=settings.bus.tls, wait=True),
        options,
        PageOptions(robot=settings.name, footprint_m=list(settings.footprint.vertices_m)),
        TeleopLimits(v_m_s=service.manual_v_max_m_s, w_rad_s=service.manual_w_max_rad_s),
        settings.lidar.base_from_laser,
    )
    print(f"dashboard: {options.url}  (robot at {robot_address}; press Ctrl-C to stop)", flush=True)
    serve(app, options, listener)


@contextmanager
def dashboard_process(config: Path | None, robot_address: str, *, wanted: bool = True) -> Iterator[None]:
    """Run the page in its own process, if `wanted`, while the robot runs in this one.

    Raises
    ------
    ThumperError
        The page cannot start: its port or the bus's is in use, or its options are wrong.
    ModuleNotFoundError
        The page is not installed.
    """
    if not wanted:
        yield
        return
    from thumper.bus.zenoh_session import check_address_free
    from thumper.config.robot import load_config

    if find_spec("nicegui") is None:
        raise ModuleNotFoundError(name="nicegui")
    bind_port(check_options(load_config(config).dashboard)).close()
    check_address_free(robot_address)  # else the page would show another robot
    command = [sys.executable, "-m", "thumper", "dashboard", "--bus", robot_address]
    if config is not None:
        command += ["--config", str(config)]
    process = subprocess.Popen(command, start_new_session=True)  # Ctrl-C goes to the robot first
    try:
        yield
    finally:
        process.terminate()
        try:
            process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
