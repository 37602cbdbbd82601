"""What a recorded log gives a mapper, whatever its format."""

from dataclasses import dataclass

from thumper.geometry import Pose2, Twist2
from thumper.lidar.scan import Scan


@dataclass(frozen=True, slots=True, kw_only=True)
class LogRecord:
    """One scan with the odometry that belongs to it, in the order of the log."""

    time_s: float  # as logged: may start anywhere, come in bursts and even step back
    odom_from_base: Pose2
    twist: Twist2  # zero where the log cannot tell the speed during the turn
    scan: Scan


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotLog:
    """A whole log in memory."""

    format_name: str
    base_from_laser: Pose2
    records: tuple[LogRecord, ...]
    notes: tuple[str, ...] = ()  # what the reader left out or guessed, a line each
