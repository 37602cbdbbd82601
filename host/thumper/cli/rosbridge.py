"""`thumper rosbridge`: connect web pages and ROS tools that speak rosbridge to a running robot."""

from typing import Annotated

import typer

from thumper.cli.options.bus import connect
from thumper.cli.options.common import BusAddress, ConfigFile, RobotName


def rosbridge(
    port: Annotated[
        int, typer.Option(help="Port to listen on; 0: [bus] rosbridge_port, 9090.", min=0, max=65535)
    ] = 0,
    host: Annotated[
        str,
        typer.Option(
            help="Address to listen on; any other than loopback needs [bus] token and a certificate."
        ),
    ] = "127.0.0.1",
    config: ConfigFile = None,
    bus: BusAddress = "",
    robot: RobotName = "",
) -> None:
    """Serve rosbridge v2 for a running robot (roslibpy, roslibjs and others) until Ctrl-C.

    Clients send a token: [bus] token, or without one a new one that the command prints.
    """
    import asyncio
    import secrets
    from contextlib import suppress

    from thumper.bus.rosbridge import Rosbridge
    from thumper.cli.options.bus import token_of
    from thumper.config.bus import is_loopback
    from thumper.config.dashboard import certificate_pair
    from thumper.config.robot import load_config
    from thumper.dashboard.certificate import server_tls

    settings = load_config(config)
    port = port or settings.bus.rosbridge_port
    pair = None if is_loopback(host) else certificate_pair(settings.dashboard)
    tls = server_tls(*pair) if pair else None
    configured = token_of(config)
    token = configured or secrets.token_urlsafe(16)
    hint = "" if configured else f", token {token}"
    with connect(config, bus, robot) as client:
        bridge = Rosbridge(client, host=host, port=port, token=token, tls=tls)
        url = f"{'wss' if tls else 'ws'}://{host}"
        with suppress(KeyboardInterrupt):
            asyncio.run(
                bridge.serve(
                    lambda bound: print(
                        f"rosbridge is running on {url}:{bound}{hint} (Ctrl-C to stop)", flush=True
                    )
                )
            )
