"""`thumper mode`: whether a running robot maps, or localises in the map that it has."""

from enum import StrEnum
from typing import Annotated

import typer

from thumper.cli.bus_options import Address, Config, Robot, join


class SlamMode(StrEnum):
    """What to do with the map, and the robot's command for it."""

    LOCALISE = "localise"
    MAP = "map"
    SEARCH = "search"


COMMAND_OF = {SlamMode.LOCALISE: "localise", SlamMode.MAP: "map_on", SlamMode.SEARCH: "relocalise"}


def mode(
    what: Annotated[
        SlamMode,
        typer.Argument(
            help="localise: keep the map as it is, and know the place in it. map: go on mapping, in a loaded "
            "map (`run --map`) too. search: forget the pose, and look for it in the whole map."
        ),
    ],
    config: Config = None,
    bus: Address = "",
    robot: Robot = "",
) -> None:
    """Change a running robot between mapping and localising; it must stand."""
    with join(config, bus, robot) as client:
        print(client.query("command", {"command": COMMAND_OF[what]})["text"])
