"""Chooses between manual commands: the gamepad has priority, and each command expires soon. Pure."""

from dataclasses import dataclass

from thumper.common.geometry import Twist2
from thumper.runtime.requests import TeleopSource, Velocity

COMMAND_TIMEOUT_S = 0.3  # six commands at the usual 20 Hz; the safety chain allows 0.5 s in all


@dataclass(frozen=True, slots=True, kw_only=True)
class ManualCommand:
    """A manual command and where it comes from."""

    source: TeleopSource
    twist: Twist2


class TwistMux:
    """Keeps the newest command of each source."""

    def __init__(
        self, *, gamepad_timeout_s: float = COMMAND_TIMEOUT_S, teleop_timeout_s: float = COMMAND_TIMEOUT_S
    ) -> None:
        self._timeout_s = {
            TeleopSource.VELOCITY: COMMAND_TIMEOUT_S,
            TeleopSource.GAMEPAD: gamepad_timeout_s,
            TeleopSource.TELEOP: teleop_timeout_s,
        }
        self._newest: dict[TeleopSource, tuple[float, Twist2]] = {}

    def add(self, at_s: float, command: Velocity) -> None:
        """Add a command received at `at_s`. Zero releases the source, so that it does not block a drive."""
        if command.twist == Twist2():
            self._newest.pop(command.channel, None)
        else:
            self._newest[command.channel] = (at_s, command.twist)

    def clear(self) -> None:
        """Forget all commands."""
        self._newest.clear()

    def active(self, now_s: float) -> ManualCommand | None:
        """Return the valid command of the highest priority; None if all have been released or expired."""
        for source in sorted(self._newest, reverse=True):
            received_s, twist = self._newest[source]
            if now_s - received_s <= self._timeout_s[source]:
                return ManualCommand(source=source, twist=twist)
            del self._newest[source]
        return None
