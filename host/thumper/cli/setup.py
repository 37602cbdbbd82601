"""`thumper setup`: the first run in the browser, from a bare board or none to a saved map."""

from dataclasses import replace

from thumper.cli.options.bus import address_of
from thumper.cli.options.common import BusAddress, ConfigFile, PageHost, PagePort


def setup(
    bus: BusAddress = "",
    host: PageHost = "",
    port: PagePort = 0,
    config: ConfigFile = None,
) -> None:
    """Guide through the first run in the browser: find port, flash, check, tune, drive, map, goal, save.

    Each step runs the command of its name and shows its result. Without a board, a simulated one takes its
    place. The guide writes a new configuration; with --config, it uses that one as it is.

    Example: `thumper setup`
    """
    from thumper.config.dashboard import check_options
    from thumper.config.robot import load_config

    settings = load_config(config)
    options = settings.dashboard
    options = replace(options, host=host or options.host, port=port or options.port)
    address = address_of(bus, settings.bus)
    listening = check_options(options)  # before the slow imports, so that errors appear at once
    from thumper.bus.zenoh_session import check_address_free
    from thumper.dashboard.guide.guide import Guide
    from thumper.dashboard.guide.robot_file import Ports
    from thumper.dashboard.process import run_dashboard

    check_address_free(address)  # else the guide would show another robot
    ports = Ports(board=settings.board.port, lidar=settings.lidar.port) if config else None
    run_dashboard(settings, listening, address, guide=Guide(address, config=config, ports=ports))
