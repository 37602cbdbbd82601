"""The options by which a command finds a running robot, and the way to it."""

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from thumper.bus.client import BusClient
    from thumper.config.bus import BusOptions

TOKEN_VARIABLE = "THUMPER_TOKEN"  # not an option: others can read a command line

Config = Annotated[
    Path | None, typer.Option(help="The robot's TOML: its name, and [bus] with address and token.")
]
Address = Annotated[str, typer.Option("--bus", help="HOST:PORT of the robot's bus.")]
Robot = Annotated[str, typer.Option(help="The robot's name on the bus.")]


def join(config: Path | None, address: str, robot: str) -> "BusClient":
    """Join the bus of the robot that the options name; the token may also be in $THUMPER_TOKEN.

    Raises
    ------
    ThumperError
        No such robot, or wrong options.
    """
    from thumper.bus.client import BusClient
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.config.bus import ROBOT_NAME, split_address

    if robot and not re.fullmatch(ROBOT_NAME, robot):
        raise ThumperError(
            f"--robot {robot!r} is no robot's name: letters, digits, - and _", exit_code=EXIT_USAGE
        )
    name, options = _settings(config)
    address = address or options.address
    try:
        split_address(address)
    except ValueError as error:
        raise ThumperError(f"--bus {error}", exit_code=EXIT_USAGE) from error
    return BusClient(robot or name, address, token_of(config))


def token_of(config: Path | None) -> str:
    """The shared secret: from the environment, or the configuration; empty for none."""
    return os.environ.get(TOKEN_VARIABLE) or _settings(config)[1].token


def _settings(config: Path | None) -> "tuple[str, BusOptions]":
    from thumper.config.bus import USUAL_ROBOT, BusOptions

    if config is None:  # reading the configuration takes a second that a stop does not have
        return USUAL_ROBOT, BusOptions()
    from thumper.config.robot import load_config

    settings = load_config(config)
    return settings.name, settings.bus
