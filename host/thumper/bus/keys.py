"""Keys of the bus: robot and clients prove to each other who they are (mutual TLS).

A certificate authority, whose own key is not kept, signs one certificate for the robot and one for all
clients. Each is valid for its side only: who has the clients' key cannot pose as the robot.
"""

import socket
from dataclasses import dataclass
from pathlib import Path

from thumper.common.certificates import make_pair, refuse_existing, write_new
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.config.bus import NO_TLS, is_loopback, split_address

AUTHORITY = "ca.crt"


@dataclass(frozen=True, slots=True, kw_only=True)
class BusKeys:
    """Files of one side of the bus."""

    authority: Path
    certificate: Path
    key: Path


def default_folder() -> Path:
    """Return where `thumper bus keys` puts the keys."""
    return Path.home() / ".config" / "thumper" / "bus"


def make_keys(folder: Path) -> list[Path]:
    """Write the certificates and keys of robot and clients; return the files.

    Raises
    ------
    ThumperError
        One of the files exists already, or cannot be written.
    """
    from cryptography.hazmat.primitives import serialization

    files = [folder / name for name in (AUTHORITY, "robot.crt", "robot.key", "client.crt", "client.key")]
    refuse_existing(*files)
    authority = make_pair(f"Thumper bus of {socket.gethostname()}", [], use="authority")
    robot = make_pair("Thumper robot", ["thumper"], issuer=authority, use="server")
    client = make_pair("Thumper client", ["thumper"], issuer=authority, use="client")
    pem = authority.certificate.public_bytes(serialization.Encoding.PEM)
    write_new(files[0], pem, mode=0o644)
    robot.write(files[1], files[2])
    client.write(files[3], files[4])
    return files


def keys_for(side: str, address: str, tls: str) -> BusKeys | None:
    """Return the keys of `side` (robot, client) for a bus at `address`; None for no TLS. `tls` as in `[bus]`.

    Loopback needs none. Other addresses need the keys of the configuration or of `thumper bus keys`.

    Raises
    ------
    ThumperError
        A file is missing.
    """
    host, _ = split_address(address)
    if tls == NO_TLS or (not tls and is_loopback(host)):
        return None
    folder = Path(tls).expanduser() if tls else default_folder()
    keys = BusKeys(
        authority=folder / AUTHORITY, certificate=folder / f"{side}.crt", key=folder / f"{side}.key"
    )
    for path in (keys.authority, keys.certificate, keys.key):
        if not path.is_file():
            fix = (
                "run `thumper bus keys` once"
                if side == "robot"
                else "copy ca.crt, client.crt and client.key from the robot's computer"
            )
            raise ThumperError(
                f"{path} is missing: the bus at {address} is encrypted; {fix}, or set [bus] tls = "
                f'"{NO_TLS}" for a network that you trust',
                exit_code=EXIT_USAGE,
            )
    return keys
