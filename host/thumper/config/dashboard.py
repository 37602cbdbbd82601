"""Options of the page: the `[dashboard]` table of the robot's TOML."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Le

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.config.bus import is_loopback

SHORTEST_PASSWORD = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class DashboardOptions:
    """Where the page is served, and to whom."""

    # 127.0.0.1: this machine alone; another address of this machine, or 0.0.0.0, lets others in.
    host: str = "127.0.0.1"
    port: Annotated[int, Ge(1), Le(65535)] = 8080
    # Asked for before anything else; must be set when the page leaves this machine.
    password: str = ""
    # PEM files for HTTPS; empty: those of `--make-certificate`.
    certificate: str = ""
    key: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Listening:
    """Checked options: what the server is started with."""

    host: str
    port: int
    password: str
    certificate: Path | None
    key: Path | None

    @property
    def secure(self) -> bool:
        """Whether it is HTTPS."""
        return self.certificate is not None

    @property
    def url(self) -> str:
        """What to type into the browser."""
        host = "localhost" if self.host in ("127.0.0.1", "::1") else self.host
        host = f"[{host}]" if ":" in host else host
        return f"{'https' if self.secure else 'http'}://{host}:{self.port}/"


def own_certificate() -> tuple[Path, Path]:
    """Where `--make-certificate` puts certificate and key."""
    folder = Path.home() / ".config" / "thumper"
    return folder / "dashboard.crt", folder / "dashboard.key"


def checked(options: DashboardOptions) -> Listening:
    """Return what to start with.

    Raises
    ------
    ThumperError
        The page would leave this machine without a password or without HTTPS, or a file is missing.
    """
    pair = certificate_pair(options)
    local = is_loopback(options.host)
    wants_https = pair is not None and (bool(options.certificate) or not local)
    if not local and len(options.password) < SHORTEST_PASSWORD:
        raise ThumperError(
            f"the dashboard would be open to everybody who reaches {options.host}: "
            f'set [dashboard] password = "..." (at least {SHORTEST_PASSWORD} characters), or leave --host',
            exit_code=EXIT_USAGE,
        )
    if not local and not wants_https:
        raise ThumperError(
            f"the dashboard on {options.host} needs HTTPS, or anybody could read the password: "
            "run `thumper dashboard --make-certificate` once, or set [dashboard] certificate and key",
            exit_code=EXIT_USAGE,
        )
    return Listening(
        host=options.host,
        port=options.port,
        password=options.password,
        certificate=pair[0] if pair and wants_https else None,
        key=pair[1] if pair and wants_https else None,
    )


def certificate_pair(options: DashboardOptions) -> tuple[Path, Path] | None:
    """Certificate and key: those that are configured, else those of `--make-certificate`, if there are any.

    Raises
    ------
    ThumperError
        What is configured is not there.
    """
    if not (options.certificate or options.key):
        own = own_certificate()
        return own if all(path.is_file() for path in own) else None
    if not (options.certificate and options.key):
        raise ThumperError("[dashboard] certificate and key belong together: set both", exit_code=EXIT_USAGE)
    certificate, key = Path(options.certificate).expanduser(), Path(options.key).expanduser()
    for path in (certificate, key):
        if not path.is_file():
            raise ThumperError(
                f"{path}: no such file; see [dashboard] certificate and key", exit_code=EXIT_USAGE
            )
    return certificate, key
