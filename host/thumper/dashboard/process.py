"""Starting the page: in this process, or as a process of its own beside the robot."""

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
from thumper.config.dashboard import Listening, checked


def bound(listening: Listening) -> socket.socket:
    """Take the port; closing the socket gives it back.

    Raises
    ------
    ThumperError
        The port is taken.
    """
    family = socket.AF_INET6 if ":" in listening.host else socket.AF_INET
    listener = socket.socket(family)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((listening.host, listening.port))
        listener.listen()  # a browser that is quicker than the page's start waits for it
    except (OSError, socket.gaierror) as error:
        listener.close()
        taken = isinstance(error, OSError) and error.errno == errno.EADDRINUSE
        why = (
            "it is taken; end the program that has it, or take another: [dashboard] port in the "
            "configuration, or --port of `thumper dashboard`, which serves the page beside a robot that runs"
            if taken
            else str(error.strerror)
        )
        raise ThumperError(f"cannot listen on {listening.host}:{listening.port}: {why}") from error
    return listener


if TYPE_CHECKING:
    from thumper.config.robot import RobotConfig

END_TIMEOUT_S = 3.0


def run_dashboard(settings: "RobotConfig", listening: Listening, robot_address: str) -> None:
    """Serve until Ctrl-C."""
    listener = bound(listening)  # before the slow imports: that it is taken is said at once
    from thumper.bus.client import BusClient
    from thumper.dashboard.bus_link import BusLink
    from thumper.dashboard.page import PageOptions
    from thumper.dashboard.page_commands import TeleopLimits
    from thumper.dashboard.server import build_app, serve

    service = settings.service
    app = build_app(
        BusLink(lambda: BusClient(settings.name, robot_address, settings.bus.token)),
        listening,
        PageOptions(robot=settings.name, footprint_m=list(settings.footprint.vertices_m)),
        TeleopLimits(v_m_s=service.manual_v_max_m_s, w_rad_s=service.manual_w_max_rad_s),
        settings.lidar.base_from_laser,
    )
    print(f"dashboard: {listening.url}  (robot at {robot_address}; Ctrl-C ends it)", flush=True)
    serve(app, listening, listener)


@contextmanager
def beside(config: Path | None, robot_address: str, *, wanted: bool = True) -> Iterator[None]:
    """Run the page in its own process, if it is wanted, while the robot's runs in this one.

    Raises
    ------
    ThumperError
        The page could not be served: its port or the bus's is taken, or it is not set up.
    ModuleNotFoundError
        It is not installed.
    """
    if not wanted:
        yield
        return
    from thumper.bus.zenoh_session import check_free
    from thumper.config.robot import load_config

    if find_spec("nicegui") is None:
        raise ModuleNotFoundError(name="nicegui")
    bound(checked(load_config(config).dashboard)).close()
    check_free(robot_address)  # the page would show another robot
    command = [sys.executable, "-m", "thumper", "dashboard", "--bus", robot_address]
    if config is not None:
        command += ["--config", str(config)]
    process = subprocess.Popen(command, start_new_session=True)  # Ctrl-C is the robot's first
    try:
        yield
    finally:
        process.terminate()
        try:
            process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
