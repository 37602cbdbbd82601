"""Options of `thumper ros`: the `[ros]` table of the robot's TOML."""

from dataclasses import asdict, dataclass
from typing import Annotated

from annotated_types import Ge, Le
from pydantic import StringConstraints, TypeAdapter, ValidationError

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.config.bus import NO_TLS, is_loopback, split_address


@dataclass(frozen=True, slots=True, kw_only=True)
class RosOptions:
    """Where the robot joins a ROS 2 network, and under which names."""

    # HOST:PORT of the Zenoh router of ROS 2 (`rmw_zenohd`).
    router: str = "127.0.0.1:7447"
    # The network's ROS_DOMAIN_ID.
    domain_id: Annotated[int, Ge(0), Le(232)] = 0
    # Namespace of the node and its topics, such as /robot1. Empty: none.
    namespace: Annotated[str, StringConstraints(pattern=r"^(/[A-Za-z_][A-Za-z0-9_]*)*$")] = ""
    # Password that the router requires of the user "thumper". Empty: none.
    token: str = ""
    # Folder with ca.crt, client.crt and client.key for a router that requires them (mutual TLS). Empty: none
    # on a loopback address, else those of `thumper bus keys`. "none": no encryption.
    tls: str = ""

    def __post_init__(self) -> None:
        host, port = split_address(self.router)
        if not is_loopback(host) and self.tls == NO_TLS and not self.token:
            raise ValueError(f"{host}:{port} is on the network: without tls, set a token that it requires")


def overridden(
    options: RosOptions, *, router: str, domain_id: int | None, namespace: str | None
) -> RosOptions:
    """Return the options with those of the command line; raises ThumperError if one is not valid."""
    given = {"router": router or None, "domain_id": domain_id, "namespace": namespace}
    merged = asdict(options) | {name: value for name, value in given.items() if value is not None}
    try:
        return TypeAdapter(RosOptions).validate_python(merged)
    except ValidationError as error:
        first = error.errors()[0]
        option = f"--{first['loc'][0]}: " if first["loc"] else "--router: "
        reason = first["msg"].removeprefix("Value error, ")
        if first["loc"] == ("namespace",):
            reason = f"{namespace!r} is not a namespace; use a slash and a name, for example /robot1"
        raise ThumperError(option + reason, exit_code=EXIT_USAGE) from error
