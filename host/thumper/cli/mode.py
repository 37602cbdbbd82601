"""`thumper mode`: switch a running robot between mapping and localization."""

from enum import StrEnum
from typing import Annotated

import typer

from thumper.cli.options.bus import connect
from thumper.cli.options.common import BusAddress, ConfigFile, RobotName


class SlamMode(StrEnum):
    """What the robot does with its map."""

    LOCALIZE = "localize"
    MAP = "map"
    SEARCH = "search"


COMMAND_OF = {SlamMode.LOCALIZE: "localize", SlamMode.MAP: "map_on", SlamMode.SEARCH: "relocalize"}


def mode(
    what: Annotated[
        SlamMode,
        typer.Argument(
            help="localize: freeze the map and localize in it. map: resume mapping, also in a map loaded "
            "with `run --map`. search: forget the pose and relocalize in the whole map, after localize."
        ),
    ],
    config: ConfigFile = None,
    bus: BusAddress = "",
    robot: RobotName = "",
) -> None:
    """Switch a stationary robot between mapping and localization, or relocalize it.

    Example: `thumper mode localize`
    """
    from thumper.ros import services
    from thumper.ros.services import RunCommand

    with connect(config, bus, robot) as client:
        print(services.COMMAND.call(client, RunCommand(command=COMMAND_OF[what])).text)
