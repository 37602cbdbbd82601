"""Options of the page: the `[dashboard]` table of the robot's TOML."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Le

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.config.bus import is_loopback

MIN_PASSWORD_CHARACTERS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class DashboardOptions:
    """Address, password and certificate of the dashboard."""

    # Address to listen on. 127.0.0.1: this computer only; 0.0.0.0: every network of this computer.
    host: str = "127.0.0.1"
    # Port of the dashboard.
    port: Annotated[int, Ge(1), Le(65535)] = 8080
    # Login password; required for any address but loopback.
    password: str = ""
    # PEM file of the certificate for HTTPS; empty: the one of `--make-certificate`.
    certificate: str = ""
    # PEM file of the certificate's private key; empty: the one of `--make-certificate`.
    key: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerOptions:
    """Checked options with which the server starts."""

    host: str
    port: int
    password: str
    certificate: Path | None
    key: Path | None

    @property
    def secure(self) -> bool:
        """Whether the page uses HTTPS."""
        return self.certificate is not None

    @property
    def url(self) -> str:
        """Address to open in the browser."""
        host = "localhost" if self.host in ("127.0.0.1", "::1") else self.host
        host = f"[{host}]" if ":" in host else host
        return f"{'https' if self.secure else 'http'}://{host}:{self.port}/"


def default_certificate() -> tuple[Path, Path]:
    """Return where `--make-certificate` puts certificate and key."""
    folder = Path.home() / ".config" / "thumper"
    return folder / "dashboard.crt", folder / "dashboard.key"


def check_options(options: DashboardOptions) -> ServerOptions:
    """Check the options and return what the server needs.

    Raises
    ------
    ThumperError
        Other computers could reach the page without a password or HTTPS, or a file is missing.
    """
    pair = certificate_pair(options)
    local = is_loopback(options.host)
    wants_https = pair is not None and (bool(options.certificate) or not local)
    if not local and len(options.password) < MIN_PASSWORD_CHARACTERS:
        raise ThumperError(
            f"anybody who can reach {options.host} could use the dashboard: "
            f'set [dashboard] password = "..." (at least {MIN_PASSWORD_CHARACTERS} characters) '
            "or omit --host",
            exit_code=EXIT_USAGE,
        )
    if not local and not wants_https:
        raise ThumperError(
            f"the dashboard on {options.host} needs HTTPS, or anybody could read the password: "
            "run `thumper dashboard --make-certificate` once, or set [dashboard] certificate and key",
            exit_code=EXIT_USAGE,
        )
    return ServerOptions(
        host=options.host,
        port=options.port,
        password=options.password,
        certificate=pair[0] if pair and wants_https else None,
        key=pair[1] if pair and wants_https else None,
    )


def certificate_pair(options: DashboardOptions) -> tuple[Path, Path] | None:
    """Return certificate and key: the configured ones, else those of `--make-certificate`, else None.

    Raises
    ------
    ThumperError
        A configured file does not exist.
    """
    if not (options.certificate or options.key):
        pair = default_certificate()
        return pair if all(path.is_file() for path in pair) else None
    if not (options.certificate and options.key):
        raise ThumperError("[dashboard] certificate and key belong together: set both", exit_code=EXIT_USAGE)
    certificate, key = Path(options.certificate).expanduser(), Path(options.key).expanduser()
    for path in (certificate, key):
        if not path.is_file():
            raise ThumperError(
                f"{path}: no such file; check [dashboard] certificate and key", exit_code=EXIT_USAGE
            )
    return certificate, key
