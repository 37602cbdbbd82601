"""`thumper dashboard`: watch and steer a running robot in the browser."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer


def dashboard(
    robot_address: Annotated[
        str, typer.Option(help="HOST:PORT of the robot's bus; overrides the configuration.")
    ] = "",
    host: Annotated[
        str, typer.Option(help="Address to serve at; any but loopback needs a password and HTTPS.")
    ] = "",
    port: Annotated[int, typer.Option(help="Port to serve at; 0: as configured.", min=0, max=65535)] = 0,
    config: Annotated[Path | None, typer.Option(help="The robot's TOML; without it, a Wild Thumper.")] = None,
    make_certificate: Annotated[
        bool, typer.Option("--make-certificate", help="Make a certificate for HTTPS, and leave.")
    ] = False,
) -> None:
    """Serve the page to watch and steer a running robot; Ctrl-C ends it, and the robot stops if it drove.

    The page speaks to `thumper run` over the bus and may be started before it.
    """
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.config.bus import split_address
    from thumper.config.dashboard import checked, own_certificate
    from thumper.config.robot import load_config

    settings = load_config(config)
    options = settings.dashboard
    options = replace(options, host=host or options.host, port=port or options.port)
    if make_certificate:
        from thumper.dashboard.certificate import make_certificate as make
        from thumper.dashboard.certificate import own_names

        certificate, key = own_certificate()
        fingerprint = make(certificate, key, own_names(options.host))
        print(f"{certificate} and {key} are there; the browser will show SHA-256 {fingerprint}")
        return
    address = robot_address or settings.bus.address
    try:
        split_address(address)
    except ValueError as error:
        raise ThumperError(f"--robot-address {error}", exit_code=EXIT_USAGE) from error
    listening = checked(options)  # before the slow imports: what is wrong is said at once
    from thumper.dashboard.process import run_dashboard

    run_dashboard(settings, listening, address)
