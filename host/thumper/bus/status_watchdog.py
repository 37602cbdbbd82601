"""Detect that a robot on the bus has stopped publishing, so that no command waits for it forever."""

import time

from thumper.bus.client import BusClient
from thumper.common.errors import EXIT_NOT_THERE, ThumperError

STATUS_TIMEOUT_S = 5.0  # a status comes each cycle, and every 4.5 s at worst while the board is reconnecting


class StatusWatchdog:
    """Watches the topic `status` of one robot."""

    def __init__(self, client: BusClient) -> None:
        self._robot = client.robot
        self.has_received = False
        self._received_s = time.monotonic()
        client.subscribe("status", self._on_status)

    def check(self) -> None:
        """Raise ThumperError if no status came for `STATUS_TIMEOUT_S`."""
        if time.monotonic() - self._received_s < STATUS_TIMEOUT_S:
            return
        reason = "has stopped publishing: its program has ended or hangs, or the network is down"
        if not self.has_received:
            reason = "publishes nothing on this bus; is that its name (--robot), and is its board connected?"
        raise ThumperError(f"robot {self._robot!r} {reason}", exit_code=EXIT_NOT_THERE)

    def _on_status(self, _: object) -> None:
        self._received_s, self.has_received = time.monotonic(), True
