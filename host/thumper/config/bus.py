"""Options of the bus: the `[bus]` table of the robot's TOML."""

import ipaddress
from dataclasses import dataclass, replace

from thumper.common.errors import EXIT_USAGE, ThumperError

MIN_TOKEN_CHARACTERS = 12
NO_TLS = "none"
DEFAULT_ROBOT = "thumper"  # name of a robot without a configuration
ROBOT_NAME_PATTERN = (
    r"^[A-Za-z0-9][A-Za-z0-9_-]{0,39}$"  # part of the bus's keys, in which / * and $ are special
)


@dataclass(frozen=True, slots=True, kw_only=True)
class BusOptions:
    """Address and access token; by default only programs on this computer can connect."""

    # HOST:PORT of the bus. Any host other than a loopback address requires a token.
    address: str = "127.0.0.1:7448"
    # Clients must present this token: at least 12 characters. Empty disables the check.
    token: str = ""
    # Folder of the keys that encrypt the bus (mutual TLS). Empty: none on a loopback address, else those of
    # `thumper bus keys`. "none": no encryption.
    tls: str = ""

    def __post_init__(self) -> None:
        host, port = split_address(self.address)
        if self.token and len(self.token) < MIN_TOKEN_CHARACTERS:
            raise ValueError(f"a token has at least {MIN_TOKEN_CHARACTERS} characters")
        if any(character in self.token for character in ":\n\r") or not self.token.isprintable():
            raise ValueError("a token must not contain a colon, line break or control character")
        if not is_loopback(host) and not self.token:
            raise ValueError(f"{host}:{port} can be reached from other computers: set a token, too")

    def at(self, address: str) -> "BusOptions":
        """Return the same bus at another address.

        Raises
        ------
        ThumperError
            The address is not valid, or requires a token.
        """
        try:
            return replace(self, address=address)
        except ValueError as error:
            raise ThumperError(f"--bus {address}: {error}", exit_code=EXIT_USAGE) from error


def split_address(address: str) -> tuple[str, int]:
    """Split HOST:PORT or [IPv6]:PORT; raises ValueError."""
    host, colon, port = address.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not colon or not host or not port.isdigit() or not 0 < int(port) < 65536:
        raise ValueError(f"{address!r} is not an address; use HOST:PORT, for example 127.0.0.1:7448")
    return host, int(port)


def is_loopback(host: str) -> bool:
    """Return whether only this computer can reach the host; names other than localhost count as reachable."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
