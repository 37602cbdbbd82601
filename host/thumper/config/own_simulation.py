"""`sim://`, the short form: a new simulated robot with its own lidar, such as `sim://?world=hall&seed=3`."""

import itertools
from urllib.parse import parse_qsl, urlencode

from thumper.common.errors import EXIT_USAGE, ThumperError

SIMULATION = "sim://"
_numbers = itertools.count(1)


def own_simulation(board: str, lidar: str, lidar_model: str) -> tuple[str, str]:
    """Return the ports of board and lidar in full; other ports than `sim://` and `sim://?...` unchanged.

    Raises
    ------
    ThumperError
        `sim://` has its own lidar, and another one is given.
    """
    rest = board.removeprefix(SIMULATION)
    if not board.startswith(SIMULATION) or (rest and not rest.startswith("?")):
        return board, lidar
    if lidar:
        raise ThumperError(f"{board} has its own lidar; leave out {lidar}", exit_code=EXIT_USAGE)
    options = parse_qsl(rest.removeprefix("?"), keep_blank_values=True)
    if "lidar" not in dict(options):
        options.append(("lidar", lidar_model))
    name = f"{SIMULATION}robot{next(_numbers)}"
    return f"{name}/board?{urlencode(options)}", f"{name}/lidar"
