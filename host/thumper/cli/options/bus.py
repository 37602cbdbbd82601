"""Connect a command to the bus of a running robot."""

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from thumper.bus.client import BusClient
    from thumper.config.bus import BusOptions

TOKEN_VARIABLE = "THUMPER_TOKEN"  # not an option: other users can read a process's command line


def connect(config: Path | None, address: str, robot: str) -> "BusClient":
    """Return a client of the robot that `--config`, `--bus` and `--robot` name.

    Raises
    ------
    ThumperError
        No such robot, or invalid options.
    """
    from thumper.bus.client import BusClient
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.config.bus import ROBOT_NAME_PATTERN

    if robot and not re.fullmatch(ROBOT_NAME_PATTERN, robot):
        raise ThumperError(
            f"--robot {robot!r} is not a robot name; use letters, digits, - and _", exit_code=EXIT_USAGE
        )
    name, options = _name_and_bus(config)
    return BusClient(robot or name, address_of(address, options), token_of(config), tls=options.tls)


def address_of(address: str, options: "BusOptions") -> str:
    """Return the address of `--bus`, else the configured one; raise ThumperError if it is none."""
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.config.bus import split_address

    address = address or options.address
    try:
        split_address(address)
    except ValueError as error:
        raise ThumperError(f"--bus {error}", exit_code=EXIT_USAGE) from error
    return address


def token_of(config: Path | None) -> str:
    """Return the bus token from $THUMPER_TOKEN or the configuration; empty for none."""
    return os.environ.get(TOKEN_VARIABLE) or _name_and_bus(config)[1].token


def _name_and_bus(config: Path | None) -> "tuple[str, BusOptions]":
    from thumper.config.bus import DEFAULT_ROBOT, BusOptions

    if config is None:  # loading the whole configuration takes 1 s, too long for `thumper stop`
        return DEFAULT_ROBOT, BusOptions()
    from thumper.config.robot import load_config

    settings = load_config(config)
    return settings.name, settings.bus
