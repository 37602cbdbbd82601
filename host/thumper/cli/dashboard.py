"""`thumper dashboard`: watch and control a running robot in the browser."""

from dataclasses import replace
from typing import Annotated

import typer

from thumper.cli.options.bus import address_of
from thumper.cli.options.common import BusAddress, ConfigFile, PageHost, PagePort


def dashboard(
    bus: BusAddress = "",
    host: PageHost = "",
    port: PagePort = 0,
    config: ConfigFile = None,
    make_certificate: Annotated[
        bool, typer.Option("--make-certificate", help="Create a certificate for HTTPS and exit.")
    ] = False,
) -> None:
    """Serve the dashboard, a browser page to watch and control a running robot, until Ctrl-C.

    The dashboard connects to `thumper run` over the bus; start the two in any order. A robot that it drives
    stops when the dashboard ends.

    Example: `thumper dashboard --bus 192.168.1.20:7448`
    """
    from thumper.config.dashboard import check_options, default_certificate
    from thumper.config.robot import load_config

    settings = load_config(config)
    options = settings.dashboard
    options = replace(options, host=host or options.host, port=port or options.port)
    if make_certificate:
        from thumper.common.certificates import local_names
        from thumper.dashboard.certificate import make_certificate as make

        certificate, key = default_certificate()
        fingerprint = make(certificate, key, local_names(options.host))
        print(f"wrote {certificate} and {key}; the browser will show SHA-256 {fingerprint}")
        return
    address = address_of(bus, settings.bus)
    listening = check_options(options)  # before the slow imports, so that errors appear at once
    from thumper.dashboard.process import run_dashboard

    run_dashboard(settings, listening, address)
