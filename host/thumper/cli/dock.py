"""`thumper dock`: dock a running robot at its charger, or undock it."""

from typing import Annotated

import typer

from thumper.cli.options.bus import connect
from thumper.cli.options.common import BusAddress, ConfigFile, RobotName


def dock(
    undock: Annotated[bool, typer.Option("--undock", help="Drive back from the dock.")] = False,
    config: ConfigFile = None,
    bus: BusAddress = "",
    robot: RobotName = "",
) -> None:
    """Dock a running robot at its charger by the tag on it, and wait until it is there. Ctrl-C cancels.

    The robot drives to the saved place `dock` of its map, or to the tag in view. Exits with 1 if it is not
    docked.

    Examples:

    - `thumper dock`
    - `thumper dock --undock`
    """
    from thumper.cli.follow_task import follow_task

    command = "undock" if undock else "dock"
    with connect(config, bus, robot) as client:
        print(
            follow_task(
                client,
                command,
                is_done=lambda text: text.startswith(f"{command}ed"),
                failed=f"not {command}ed",
            )
        )
