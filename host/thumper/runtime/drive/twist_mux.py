"""Who drives by hand: the gamepad goes before the page, and each is believed only for a moment. Pure."""

from thumper.common.geometry import Twist2
from thumper.config.manual_drive import ManualDriveOptions
from thumper.runtime.requests import TeleopSource, Velocity


class TwistMux:
    """Keeps the newest command of each channel."""

    def __init__(self, options: ManualDriveOptions) -> None:
        self._timeout_s = {
            TeleopSource.GAMEPAD: options.gamepad_timeout_s,
            TeleopSource.TELEOP: options.teleop_timeout_s,
        }
        self._newest: dict[TeleopSource, tuple[float, Twist2]] = {}

    def take(self, at_s: float, command: Velocity) -> None:
        """Take a command that came at `at_s`. Zero lets go: it must not hold up a planned drive."""
        if command.twist == Twist2():
            self._newest.pop(command.channel, None)
        else:
            self._newest[command.channel] = (at_s, command.twist)

    def clear(self) -> None:
        """Forget all commands."""
        self._newest.clear()

    def active(self, now_s: float) -> tuple[TeleopSource, Twist2] | None:
        """Return who drives, and how; None when everybody has let go or fallen silent."""
        for channel in sorted(self._newest, reverse=True):
            came_s, twist = self._newest[channel]
            if now_s - came_s <= self._timeout_s[channel]:
                return channel, twist
            del self._newest[channel]
        return None
