"""Ports of the demo in the browser: those of the robot, or others if a program uses them."""

import socket
from dataclasses import replace

from thumper.config.bus import split_address
from thumper.config.robot import RobotConfig


def on_free_ports(config: RobotConfig) -> RobotConfig:
    """Return the configuration with other ports for page and bus if another program uses its own."""
    host, port = split_address(config.bus.address)
    bus = config.bus.at(f"{host}:{free_port(host, port)}")
    page = config.dashboard
    return replace(config, bus=bus, dashboard=replace(page, port=free_port(page.host, page.port)))


def free_port(host: str, port: int) -> int:
    """Return `port` if it is free on this computer, else another that is."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError:
            probe.bind((host, 0))
        return int(probe.getsockname()[1])
