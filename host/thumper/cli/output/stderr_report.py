"""Lines on stderr, apart from the output of a command."""

import sys
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from thumper.config.robot import RobotConfig


def report_to_stderr(text: str) -> None:
    """Print a line about the robot or the bus, with the time of day: the command may run for hours."""
    print(f"{time.strftime('%H:%M:%S')} thumper: {text}", file=sys.stderr, flush=True)


def report_unused_ports(configured: "RobotConfig", used: "RobotConfig") -> None:
    """Name the ports of `configured` that a simulated board replaces in `used`."""
    from thumper.config.robot import unused_ports

    if used.board.port.startswith("sim:") and (unused := unused_ports(configured, used)):
        text = f"thumper: the simulated board brings its own sensors; not used: {', '.join(unused)}"
        print(text, file=sys.stderr, flush=True)
