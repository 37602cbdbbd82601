"""The ports of `Robot`: those that it is given, or those of a new simulated robot."""

import itertools
from urllib.parse import parse_qsl, urlencode

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.config.robot import RobotConfig, with_ports

SIMULATION = "sim://"
_simulation_numbers = itertools.count(1)


def on_ports(config: RobotConfig, board: str, lidar: str) -> RobotConfig:
    """Return the configuration with these ports.

    Raises
    ------
    ThumperError
        "sim://" has its own lidar, and another one is given.
    """
    if not board.startswith(SIMULATION):
        return with_ports(config, board=board, lidar=lidar)
    rest = board.removeprefix(SIMULATION)
    if rest and not rest.startswith("?"):
        return with_ports(config, board=board, lidar=lidar)  # a named simulation, as for the commands
    if lidar:
        raise ThumperError(f"Robot: {SIMULATION} has its own lidar; leave out {lidar}", exit_code=EXIT_USAGE)
    options = parse_qsl(rest.removeprefix("?"), keep_blank_values=True)
    if "lidar" not in dict(options):
        options.append(("lidar", config.lidar.model))
    name = f"{SIMULATION}robot{next(_simulation_numbers)}"
    return with_ports(config, board=f"{name}/board?{urlencode(options)}", lidar=f"{name}/lidar")
