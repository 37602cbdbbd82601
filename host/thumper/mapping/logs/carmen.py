"""CARMEN text logs (.log, .clf): FLASER and ROBOTLASER1 lines.

Format: the header that CARMEN's logger writes, and http://carmen.sourceforge.net/doc/binary__loggerplayback.html.
"""

import math
from collections.abc import Iterable

import numpy as np

from thumper.errors import ThumperError
from thumper.geometry import Pose2, Twist2
from thumper.lidar.scan import Scan
from thumper.mapping.logs.record import LogRecord, RobotLog

NO_RETURN_M = 80.0  # SICK scanners report 81.83 or 81.91 for "nothing came back", whatever the reason

KEYWORDS = ("FLASER", "ROBOTLASER1")


def is_carmen(lines: Iterable[str]) -> bool:
    """Whether a line starts with a keyword that this reader understands."""
    return any(line.split(" ", 1)[0] in KEYWORDS for line in lines)


def read_carmen(name: str, lines: Iterable[str]) -> RobotLog:
    """Parse the lines; `name` is the file's, for messages.

    Raises
    ------
    ThumperError
        A laser line is cut off, has a field that is not a number, or there is none.
    """
    records: list[LogRecord] = []
    base_from_laser = Pose2()
    for number, line in enumerate(lines, start=1):
        keyword = line.split(" ", 1)[0]
        if keyword not in KEYWORDS:
            continue
        try:
            record, mount = (_flaser if keyword == "FLASER" else _robotlaser)(line.split())
        except (ValueError, IndexError) as error:
            raise ThumperError(
                f"{name}: line {number}: broken {keyword} ({error}); the file may be cut off: copy it again"
            ) from error
        if not records:
            base_from_laser = mount
        records.append(record)
    if not records:
        raise ThumperError(f"{name}: no FLASER or ROBOTLASER1 line in it; is it the right file?")
    return RobotLog(format_name="CARMEN", base_from_laser=base_from_laser, records=tuple(records))


def _pose(fields: list[str]) -> Pose2:
    x_m, y_m, theta_rad = (float(field) for field in fields)
    return Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)


def _record(
    time_s: float,
    odom_from_base: Pose2,
    ranges_m: np.ndarray[tuple[int], np.dtype[np.float64]],
    no_return_m: float,
    angle_min_rad: float,
    angle_increment_rad: float,
) -> LogRecord:
    # "No return" is neither a hit nor proof of free space: glass and black walls look like that too.
    silent = (ranges_m >= no_return_m) | ~(ranges_m > 0.0)
    scan = Scan(
        time_s=time_s,
        ranges_m=np.where(silent, np.nan, ranges_m),
        angle_min_rad=angle_min_rad,
        angle_increment_rad=angle_increment_rad,
        range_max_m=no_return_m,
    )
    return LogRecord(time_s=time_s, odom_from_base=odom_from_base, twist=Twist2(), scan=scan)


def _flaser(fields: list[str]) -> tuple[LogRecord, Pose2]:
    """FLASER n r1..rn laser(x y theta) odom(x y theta) ipc_timestamp host logger_timestamp."""
    n = int(fields[1])
    if len(fields) < n + 9:
        raise ValueError(f"{len(fields)} fields, {n + 9} expected")
    ranges_m = np.array(fields[2 : 2 + n], dtype=np.float64)
    odom_from_laser, odom_from_base = _pose(fields[2 + n : 5 + n]), _pose(fields[5 + n : 8 + n])
    # Half a turn by convention; 181 or 361 beams include both ends, 180 or 360 only the first.
    increment_rad = math.pi / (n - 1 if n % 2 else n)
    record = _record(
        float(fields[8 + n]), odom_from_base, ranges_m, NO_RETURN_M, -0.5 * math.pi, increment_rad
    )
    return record, odom_from_base.inverse() @ odom_from_laser


def _robotlaser(fields: list[str]) -> tuple[LogRecord, Pose2]:
    """ROBOTLASER1 type start fov step max accuracy mode n r1..rn m s1..sm laser robot tv rv 3*safety stamp"""
    start_rad, step_rad, maximum_m = float(fields[2]), float(fields[4]), float(fields[5])
    n = int(fields[8])
    after = 10 + n + int(fields[9 + n])
    if len(fields) < after + 12:
        raise ValueError(f"{len(fields)} fields, {after + 12} expected")
    ranges_m = np.array(fields[9 : 9 + n], dtype=np.float64)
    odom_from_laser, odom_from_base = _pose(fields[after : after + 3]), _pose(fields[after + 3 : after + 6])
    limit_m = min(maximum_m, NO_RETURN_M)
    record = _record(float(fields[after + 11]), odom_from_base, ranges_m, limit_m, start_rad, step_rad)
    return record, odom_from_base.inverse() @ odom_from_laser
