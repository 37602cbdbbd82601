"""Options of the motor board: the `[board]` table of the robot's TOML."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardOptions:
    """Serial port and baud rate of the motor board."""

    port: str = "/dev/ttyUSB0"  # serial device or sim://NAME/board
    baud: Literal[250_000, 500_000] = 500_000  # must match the firmware
