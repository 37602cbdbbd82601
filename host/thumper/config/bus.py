"""Where the bus listens, and who may join it: the `[bus]` table of the robot's TOML."""

import ipaddress
from dataclasses import dataclass, replace
from typing import Annotated

from annotated_types import Ge, Le

from thumper.common.errors import EXIT_USAGE, ThumperError

LEAST_TOKEN_CHARACTERS = 12
USUAL_ROBOT = "thumper"  # the name of a robot without a configuration
ROBOT_NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]{0,39}$"  # a part of the bus's keys, where / * and $ mean something


@dataclass(frozen=True, slots=True, kw_only=True)
class BusOptions:
    """Nothing outside this machine hears or commands the robot unless told so here."""

    # HOST:PORT to listen at. Any host but a loopback one needs a token.
    address: str = "127.0.0.1:7447"
    # Shared secret that everybody who joins must know; at least 12 characters, empty for none.
    token: str = ""
    # Port at which `thumper rosbridge` listens.
    rosbridge_port: Annotated[int, Ge(1), Le(65535)] = 9090

    def __post_init__(self) -> None:
        host, port = split_address(self.address)
        if self.token and len(self.token) < LEAST_TOKEN_CHARACTERS:
            raise ValueError(f"a token has at least {LEAST_TOKEN_CHARACTERS} characters")
        if any(character in self.token for character in ":\n\r") or not self.token.isprintable():
            raise ValueError("a token has no colon, line break or control character")
        if not is_loopback(host) and not self.token:
            raise ValueError(f"{host}:{port} can be reached from other machines: set a token as well")

    def at(self, address: str) -> "BusOptions":
        """The same bus at another address.

        Raises
        ------
        ThumperError
            It is no address, or one that needs a token.
        """
        try:
            return replace(self, address=address)
        except ValueError as error:
            raise ThumperError(f"--bus {address}: {error}", exit_code=EXIT_USAGE) from error


def split_address(address: str) -> tuple[str, int]:
    """HOST:PORT, or [IPv6]:PORT, in two; raises ValueError."""
    host, colon, port = address.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not colon or not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise ValueError(f"{address!r} is no address; give HOST:PORT, as in 127.0.0.1:7447")
    return host, int(port)


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach it; a name other than localhost counts as reachable."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
