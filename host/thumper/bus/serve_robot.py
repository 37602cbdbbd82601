"""Put a robot on the bus for as long as it runs."""

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
    """Let a drive be watched and stopped over the bus; it does not depend on it."""
    with ExitStack() as stack:
        try:
            stack.enter_context(on_bus(robot, name, options))
        except ThumperError as error:
            print(f"thumper: nobody can watch or stop this drive: {error}", file=sys.stderr)
        yield


@contextmanager
def on_bus(robot: RobotLoop, name: str, options: BusOptions) -> Iterator[BusServer]:
    """Publish what `robot` makes and let others ask of it.

    Raises
    ------
    ThumperError
        The address is taken.
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
