"""`thumper foxglove`: watch and command a running robot in Foxglove."""

from typing import Annotated

import typer

from thumper.cli.options.bus import connect
from thumper.cli.options.common import BusAddress, ConfigFile, RobotName
from thumper.cli.output.stderr_report import report_to_stderr

CHECK_PERIOD_S = 0.5


def foxglove(
    port: Annotated[int, typer.Option(help="Port to listen on.", min=1, max=65535)] = 8765,
    host: Annotated[
        str,
        typer.Option(help="Address to listen on; any other than loopback needs a certificate."),
    ] = "127.0.0.1",
    config: ConfigFile = None,
    bus: BusAddress = "",
    robot: RobotName = "",
) -> None:
    """Serve a running robot to Foxglove until Ctrl-C: open the printed address as *Foxglove WebSocket*.

    Clients need the token in the address: [bus] token, or without one a new one.

    Examples:

    - `thumper foxglove`
    - `thumper foxglove --bus 192.168.1.20:7448`
    """
    import asyncio
    import secrets
    import ssl
    from contextlib import suppress
    from urllib.parse import quote

    from thumper.bus.status_watchdog import StatusWatchdog
    from thumper.cli.options.bus import token_of
    from thumper.common.optional_packages import require_extra

    require_extra("foxglove")
    from thumper.config.bus import is_loopback
    from thumper.config.dashboard import certificate_pair
    from thumper.config.robot import load_config
    from thumper.dashboard.certificate import server_tls
    from thumper.foxglove.node import FoxgloveNode, PanelParameters
    from thumper.foxglove.token_gate import TokenGate
    from thumper.ros2.gateway import RosGateway
    from thumper.ros2.services import RosServices
    from thumper.ros2.wire import NodeName, node_name

    settings = load_config(config)
    pair = None if is_loopback(host) else certificate_pair(settings.dashboard)
    tls = server_tls(*pair) if pair else None
    token = token_of(config) or secrets.token_urlsafe(16)
    with (
        connect(config, bus, robot) as client,
        FoxgloveNode(
            NodeName(domain_id=0, name=node_name(client.robot)), PanelParameters(client, report_to_stderr)
        ) as node,
    ):
        RosGateway(client, node, settings, report_to_stderr)
        RosServices(client, node)
        backend = node.start()
        trust = ssl.create_default_context(cafile=node.certificate)
        gate = TokenGate(host=host, port=port, token=token, backend=backend, trust=trust, tls=tls)
        url = f"{'wss' if tls else 'ws'}://{host}:{port}/?token={quote(token)}"
        hint = f"in Foxglove, open {url} (Ctrl-C to stop)"
        watchdog = StatusWatchdog(client, report_to_stderr)

        async def watch() -> None:
            while True:
                watchdog.check()
                await asyncio.sleep(CHECK_PERIOD_S)

        async def serve() -> None:
            await asyncio.gather(gate.serve(lambda _: print(hint, flush=True)), watch())

        with suppress(KeyboardInterrupt):
            asyncio.run(serve())
