"""Whether a robot on the bus still talks: who waits for its messages must not wait for ever."""

import time

from thumper.bus.client import BusClient
from thumper.common.errors import EXIT_NOT_THERE, ThumperError

SILENCE_S = 5.0  # a status comes each beat; each 4.5 s at worst while the robot looks for its board


class HeartbeatSender:
    """Hears a robot's status, whatever else its owner waits for."""

    def __init__(self, client: BusClient) -> None:
        self._robot = client.robot
        self.has_talked = False
        self._heard_s = time.monotonic()
        client.subscribe("status", self._hear)

    def check(self) -> None:
        """Raise ThumperError when nothing came for `SILENCE_S`."""
        if time.monotonic() - self._heard_s < SILENCE_S:
            return
        why = "says nothing any more: its program has ended or hangs, or the network is gone"
        if not self.has_talked:
            why = "says nothing on this bus; is that its name (--robot), and is its board connected?"
        raise ThumperError(f"robot {self._robot!r} {why}", exit_code=EXIT_NOT_THERE)

    def _hear(self, _: object) -> None:
        self._heard_s, self.has_talked = time.monotonic(), True
