"""The map over the bus: whole once, then only what changes."""

from collections.abc import Callable
from typing import Protocol

from thumper.ros.codec import Message
from thumper.ros.from_ros import stamp_ns_of, time_ns_of


class MapSource(Protocol):
    """What is needed of a bus client."""

    def subscribe(self, topic: str, callback: Callable[[Message], None]) -> None:
        """Call `callback` with each message of a topic."""

    def newest(self, topic: str) -> Message | None:
        """Return the newest message of a latched topic."""


class MapFeed:
    """Passes on each change to the map that was passed on before, else the whole map.

    A change names the stamp of the map that it changes. If that is another one, because the client is new, a
    message was lost, the map has grown or the robot has restarted, the whole map is fetched.
    """

    def __init__(self, bus: MapSource, on_message: Callable[[str, Message], None]) -> None:
        """`on_message` receives topic, `map` or `map_changes`, and message, on a thread of the bus."""
        self._bus, self._on_message = bus, on_message
        self._stamp_ns = 0  # of the map passed on; zero is before every map
        bus.subscribe("map_changes", self._on_change)

    def _on_change(self, change: Message) -> None:
        stamp_ns = stamp_ns_of(change)
        if stamp_ns == self._stamp_ns:  # the whole map was fetched after this change
            return
        if self._stamp_ns and time_ns_of(change.before) == self._stamp_ns:
            self._stamp_ns = stamp_ns
            self._on_message("map_changes", change)
            return
        whole = self._bus.newest("map")
        if whole is not None:
            self._stamp_ns = stamp_ns_of(whole)
            self._on_message("map", whole)
