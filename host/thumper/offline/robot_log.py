"""What a recorded log gives a mapper, whatever its format."""

from dataclasses import dataclass

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.lidar.scan import Scan

MAX_BROKEN_SHARE = 0.1  # share of broken lines beyond which a file is not worth trusting
FARTHEST_M = 1e8  # twice round the earth; of what is beyond, too few digits are left for the rest of the log
NO_ODOMETRY = "no odometry that moves: the scans alone tell the way; --method scan_match is the surest then"


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
    has_odometry: bool = True  # else all `odom_from_base` are the same


def check_pose(odom_from_base: Pose2) -> Pose2:
    """Give the pose back; raises ValueError for one that is no place at all, however the log came by it."""
    farthest_m = max(abs(odom_from_base.x_m), abs(odom_from_base.y_m))
    if not farthest_m < FARTHEST_M:
        raise ValueError(f"a pose {farthest_m:.0e} m away")
    return odom_from_base


def broken_note(broken: list[str]) -> tuple[str, ...]:
    """One line on the lines that were left out, or none."""
    return (f"{len(broken)} broken lines left out, the first: {broken[0]}",) if broken else ()


def refuse_fov(name: str, fov_rad: float | None, what: str) -> None:
    """Raise ThumperError for a field of view that was given for a log which tells its own."""
    if fov_rad is not None:
        raise ThumperError(
            f"{name}: {what} tells its field of view itself; leave out --fov", exit_code=EXIT_USAGE
        )
