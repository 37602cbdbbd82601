"""Serve a robot on the bus while it runs."""

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from thumper.bus.server import BusServer
from thumper.common.errors import ThumperError
from thumper.config.bus import BusOptions
from thumper.runtime.loop import RobotLoop
from thumper.runtime.requests import LogMessage


@contextmanager
def on_bus_if_free(robot: RobotLoop, name: str, options: BusOptions) -> Iterator[None]:
    """Serve `robot` on the bus if the address is free; otherwise print a warning and go on without."""
    with ExitStack() as stack:
        try:
            stack.enter_context(on_bus(robot, name, options))
        except ThumperError as error:
            print(f"thumper: no one can watch or stop this drive over the bus: {error}", file=sys.stderr)
        yield


@contextmanager
def on_bus(robot: RobotLoop, name: str, options: BusOptions) -> Iterator[BusServer]:
    """Publish the messages of `robot` and accept requests.

    Raises
    ------
    ThumperError
        The address is in use.
    """
    server = BusServer(
        name, options, robot.request_queue, lambda text: robot.request_queue.put(LogMessage(text=text))
    )
    robot.publisher.add_sink(server.publish)
    try:
        yield server
    finally:
        robot.publisher.remove_sink(server.publish)
        server.close()
