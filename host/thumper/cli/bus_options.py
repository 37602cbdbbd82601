"""The options by which a command finds a running robot, and the way to it."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from thumper.bus.client import BusClient

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
    from thumper.bus.options import split_address
    from thumper.config.robot import load_config
    from thumper.errors import ThumperError

    settings = load_config(config)
    address = address or settings.bus.address
    try:
        split_address(address)
    except ValueError as error:
        raise ThumperError(f"--bus {error}", exit_code=2) from error
    return BusClient(robot or settings.name, address, token_of(config))


def token_of(config: Path | None) -> str:
    """The shared secret: from the environment, or the configuration; empty for none."""
    from thumper.config.robot import load_config

    return os.environ.get(TOKEN_VARIABLE) or load_config(config).bus.token
