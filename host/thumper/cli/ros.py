"""`thumper ros`: make a running robot a node of a ROS 2 network."""

from typing import Annotated

import typer

from thumper.cli.options.bus import connect
from thumper.cli.options.common import BusAddress, ConfigFile, RobotName
from thumper.cli.output.stderr_report import report_to_stderr

CHECK_PERIOD_S = 0.5


def ros(
    router: Annotated[
        str, typer.Option(help="HOST:PORT of the network's rmw_zenohd; overrides the configuration.")
    ] = "",
    domain_id: Annotated[
        int | None,
        typer.Option(
            "--domain",
            envvar="ROS_DOMAIN_ID",
            min=0,
            max=232,
            help="Domain id of the network; overrides the configuration.",
        ),
    ] = None,
    namespace: Annotated[
        str | None, typer.Option(help="Namespace of the node, such as /robot1; overrides the configuration.")
    ] = None,
    nav2: Annotated[
        bool,
        typer.Option(
            "--nav2", help="Leave goals, plans and costmaps to Nav2, which drives the base by cmd_vel."
        ),
    ] = False,
    config: ConfigFile = None,
    bus: BusAddress = "",
    robot: RobotName = "",
) -> None:
    """Make a running robot a ROS 2 node over rmw_zenoh until Ctrl-C; ROS need not be installed here.

    Example: `thumper ros --router 127.0.0.1:7447`
    """
    import time
    from contextlib import suppress

    from thumper.bus.status_watchdog import StatusWatchdog
    from thumper.bus.zenoh_session import open_ros_client
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.config.robot import load_config
    from thumper.config.ros import overridden
    from thumper.ros2.gateway import RosGateway
    from thumper.ros2.navigation import NavigationActions
    from thumper.ros2.node import RosNode
    from thumper.ros2.parameters import RosParameters
    from thumper.ros2.services import RosServices
    from thumper.ros2.wire import NodeName, node_name

    settings = load_config(config)
    options = overridden(settings.ros, router=router, domain_id=domain_id, namespace=namespace)
    if options.router == (bus or settings.bus.address):
        raise ThumperError(
            f"--router {options.router} is the robot's own bus; pass the address of `rmw_zenohd`",
            exit_code=EXIT_USAGE,
        )
    with connect(config, bus, robot) as client:
        name = NodeName(
            domain_id=options.domain_id, name=node_name(client.robot), namespace=options.namespace
        )
        with RosNode(name, open_ros_client(options.router, options.token, options.tls)) as node:
            RosGateway(client, node, settings, report_to_stderr, navigates=not nav2)
            answers = RosServices(client, node, navigates=not nav2)
            RosParameters(client, node)
            if not nav2:
                NavigationActions(client, node, settings, lambda: answers.map)
            watchdog = StatusWatchdog(client, report_to_stderr)
            print(
                f"{node.name.qualified(name.name)} is a node of domain {name.domain_id} at {options.router} "
                "(Ctrl-C to stop)",
                flush=True,
            )
            was_connected = True
            with suppress(KeyboardInterrupt):
                while True:
                    watchdog.check()
                    if node.is_connected != was_connected:
                        was_connected = not was_connected
                        state = "is back" if was_connected else "is gone; waiting for it to return"
                        report_to_stderr(f"the ROS 2 router at {options.router} {state}")
                    time.sleep(CHECK_PERIOD_S)
