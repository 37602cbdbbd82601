"""Text logs of the Mines ParisTech robot (.dat): a Hokuyo URG-04LX and wheel encoders, one scan per line.

Format and vehicle: B. Steux, O. El Hamzaoui, "CoreSLAM: a SLAM algorithm in less than 200 lines of C code",
ICARCV 2010, and the data published with it.
"""

import math
from collections.abc import Iterable

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2
from thumper.common.kinematics import DriveGeometry
from thumper.lidar.scan import Scan
from thumper.odometry.wheel_odometry import WheelOdometry, advance
from thumper.offline.robot_log import MAX_BROKEN_SHARE, LogRecord, RobotLog, broken_note, refuse_fov

GEOMETRY = DriveGeometry(wheel_radius_m=0.077, track_m=0.33, counts_per_rev=2000)
BASE_FROM_LASER = Pose2(x_m=0.145)

FIRST_RANGE, BEAMS = 24, 682
BEAM_STEP_RAD = math.tau / 1024
REVOLUTION_S = 0.0986
ERROR_CODES_BELOW_MM = 20  # 0: no reading; 1...19: the sensor's error codes


def recognizes(line: str, *, is_first: bool) -> bool:
    """Return whether the first line has the shape of this format: many integers and one voltage."""
    fields = line.split()
    return (
        is_first
        and len(fields) >= FIRST_RANGE + BEAMS // 2
        and all(field.replace(".", "", 1).lstrip("-").isdigit() for field in fields)
    )


def read(name: str, lines: Iterable[str], fov_rad: float | None = None) -> RobotLog:
    """Parse the lines; `name` is the file, for messages. Drops and notes broken lines.

    Raises
    ------
    ThumperError
        Too many lines are truncated or have fields that are not numbers, or a field of view is given.
    """
    refuse_fov(name, fov_rad, "a MINES log")
    odometry = WheelOdometry(GEOMETRY)
    records: list[LogRecord] = []
    broken: list[str] = []
    sizes: set[int] = set()
    for number, line in enumerate((line for line in lines if not line.isspace()), start=1):
        try:
            fields = line.split()
            sizes.add(len(fields))
            records.append(_record(fields, odometry))
        except ValueError as error:
            broken.append(f"line {number}: broken scan ({error})")
    if not records and len(sizes) == 1:
        raise ThumperError(
            f"{name}: {sizes.pop()} numbers a line, but a MINES log has {FIRST_RANGE + BEAMS}: another kind "
            "of log; pass a CARMEN or MCAP log",
            exit_code=EXIT_USAGE,
        )
    if not records or len(broken) > max(1, MAX_BROKEN_SHARE * len(records)):
        raise ThumperError(
            f"{name}: {broken[0]}; the file may be cut off: copy it again", exit_code=EXIT_USAGE
        )
    return RobotLog(
        format_name="MINES",
        base_from_laser=BASE_FROM_LASER,
        records=tuple(records),
        notes=broken_note(broken),
    )


def _record(fields: list[str], odometry: WheelOdometry) -> LogRecord:
    if len(fields) < FIRST_RANGE + BEAMS:
        raise ValueError(f"{len(fields)} fields, {FIRST_RANGE + BEAMS} expected")
    time_s = 1e-6 * int(fields[0])
    sample = odometry.update(time_s, int(fields[2]), int(fields[3]))
    ranges_mm = np.array(fields[FIRST_RANGE : FIRST_RANGE + BEAMS], dtype=np.float64)
    scan = Scan(
        time_s=time_s,
        ranges_m=np.where(ranges_mm < ERROR_CODES_BELOW_MM, np.nan, 1e-3 * ranges_mm),
        angle_min_rad=-0.5 * (BEAMS - 1) * BEAM_STEP_RAD,
        angle_increment_rad=BEAM_STEP_RAD,
        time_increment_s=REVOLUTION_S / 1024,
        range_max_m=5.6,
    )
    # The robot writes a line at the end of a revolution, so the first beam is one revolution older.
    twist = sample.twist
    odom_from_base = advance(
        sample.odom_from_base, -REVOLUTION_S * twist.v_m_s, -REVOLUTION_S * twist.w_rad_s
    )
    return LogRecord(time_s=time_s, odom_from_base=odom_from_base, twist=twist, scan=scan)
