"""Put a robot on the bus for as long as it runs."""

from collections.abc import Iterator
from contextlib import contextmanager

from thumper.bus.options import BusOptions
from thumper.bus.server import BusServer
from thumper.runtime import Runtime
from thumper.service.requests import Notice


@contextmanager
def on_bus(robot: Runtime, name: str, options: BusOptions) -> Iterator[BusServer]:
    """Publish what `robot` makes and let others ask of it.

    Raises
    ------
    ThumperError
        The address is taken.
    """
    server = BusServer(name, options, robot.inbox, lambda text: robot.inbox.put(Notice(text=text)))
    robot.products.add(server.publish)
    try:
        yield server
    finally:
        robot.products.remove(server.publish)
        server.close()
