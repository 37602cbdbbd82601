"""Detect that a robot on the bus has stopped publishing, so that no command waits for it without a word."""

import time
from collections.abc import Callable

from thumper.bus.client import BusClient
from thumper.common.errors import EXIT_NOT_THERE, ThumperError

STATUS_TIMEOUT_S = 5.0  # a status comes each cycle, and every 4.5 s at worst while the board is reconnecting
NEVER = "publishes nothing on this bus; is that its name (--robot), and is its board connected?"
STOPPED = "has stopped publishing: its program has ended or hangs, or the network is down"


class StatusWatchdog:
    """Watches the topic `status` of one robot."""

    def __init__(self, client: BusClient, report: Callable[[str], None] | None = None) -> None:
        """`report` receives a line when the robot is lost and when it is back; without it, `check` raises."""
        self._robot, self._report = client.robot, report
        self.has_received = False
        self._is_lost = False
        self._received_s = time.monotonic()
        client.subscribe("status", self._on_status)

    def check(self) -> None:
        """Raise ThumperError if no status ever came for `STATUS_TIMEOUT_S`; report or raise later losses."""
        if time.monotonic() - self._received_s < STATUS_TIMEOUT_S:
            if self._is_lost and self._report is not None:
                self._report(f"robot {self._robot!r} is back")
            self._is_lost = False
        elif self._report is None or not self.has_received:
            reason = STOPPED if self.has_received else NEVER
            raise ThumperError(f"robot {self._robot!r} {reason}", exit_code=EXIT_NOT_THERE)
        elif not self._is_lost:
            self._is_lost = True
            self._report(f"robot {self._robot!r} {STOPPED}; waiting for it to return (Ctrl-C to stop)")

    def _on_status(self, _: object) -> None:
        self._received_s, self.has_received = time.monotonic(), True
