"""The content of a recorded log, in the form that all log readers return."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Protocol

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.lidar.scan import Scan
from thumper.slam.mounting import MountFinding, corrected_laser, corrected_odometry, corrected_scan

MAX_BROKEN_SHARE = 0.1  # refuse a file with a larger share of broken lines
MAX_POSITION_M = 1e8  # twice around the earth; larger values leave too few digits for the rest of the log
NO_ODOMETRY = "no odometry that moves: only the scans give the motion"


@dataclass(frozen=True, slots=True, kw_only=True)
class LogRecord:
    """One scan with its odometry, in the order of the log."""

    time_s: float  # as logged: may start anywhere, come in bursts and even step back
    odom_from_base: Pose2
    twist: Twist2  # zero if the log does not contain the speed during the revolution
    scan: Scan


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotLog:
    """A whole log in memory."""

    format_name: str
    base_from_laser: Pose2
    records: tuple[LogRecord, ...]
    notes: tuple[str, ...] = ()  # what the reader dropped or assumed, one line each
    has_odometry: bool = True  # else all `odom_from_base` are the same


class TextLogFormat(Protocol):
    """A text format. The modules `carmen` and `mines_paristech` are the implementations."""

    def recognizes(self, line: str, *, is_first: bool) -> bool:
        """Return whether the line identifies this format; `is_first` is the first line with text."""
        ...

    def read(self, name: str, lines: Iterable[str], fov_rad: float | None) -> RobotLog:
        """Parse the lines; `name` is the file, for messages. Drops and notes broken lines.

        `fov_rad` is the field of view, for a log that does not contain it.

        Raises
        ------
        ThumperError
            Too many lines are broken, no scan is left, or the log contains its field of view itself.
        """
        ...


def corrected(log: RobotLog, mounting: MountFinding) -> RobotLog:
    """Return the log with lidar and odometry in this reading."""
    mirrors = mounting in (MountFinding.MIRRORED, MountFinding.MIRRORED_HEADING)
    return replace(
        log,
        base_from_laser=corrected_laser(log.base_from_laser, mounting),
        records=tuple(
            replace(
                record,
                odom_from_base=corrected_odometry(record.odom_from_base, mounting),
                twist=replace(record.twist, w_rad_s=-record.twist.w_rad_s) if mirrors else record.twist,
                scan=corrected_scan(record.scan, mounting),
            )
            for record in log.records
        ),
    )


def check_pose(odom_from_base: Pose2) -> Pose2:
    """Return the pose; raise ValueError if it is too far away to be real, or NaN."""
    farthest_m = max(abs(odom_from_base.x_m), abs(odom_from_base.y_m))
    if not farthest_m < MAX_POSITION_M:
        raise ValueError(f"a pose {farthest_m:.0e} m away")
    return odom_from_base


def broken_note(broken: list[str]) -> tuple[str, ...]:
    """Return one line about the dropped lines, or none."""
    return (f"{len(broken)} broken lines dropped, the first: {broken[0]}",) if broken else ()


def refuse_fov(name: str, fov_rad: float | None, what: str) -> None:
    """Raise ThumperError if a field of view was given for a log that contains its own."""
    if fov_rad is not None:
        raise ThumperError(
            f"{name}: {what} contains its field of view; leave out --fov", exit_code=EXIT_USAGE
        )
