"""Text logs of the Mines ParisTech robot (.dat): a Hokuyo URG-04LX and wheel encoders, one scan a line.

Format and vehicle: B. Steux, O. El Hamzaoui, "CoreSLAM: a SLAM algorithm in less than 200 lines of C code",
ICARCV 2010, and the data published with it.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2
from thumper.common.kinematics import DriveGeometry
from thumper.lidar.scan import Scan
from thumper.odometry.wheel_odometry import WheelOdometry, advance
from thumper.offline.robot_log import MAX_BROKEN_SHARE, LogRecord, RobotLog, broken_note

GEOMETRY = DriveGeometry(wheel_radius_m=0.077, track_m=0.33, counts_per_rev=2000)
BASE_FROM_LASER = Pose2(x_m=0.145)

FIRST_RANGE, BEAMS = 24, 682
BEAM_STEP_RAD = math.tau / 1024
TURN_S = 0.0986  # one revolution of the mirror
ERROR_CODES_BELOW_MM = 20  # 0: no reading; 1...19: the sensor's error codes


def is_mines(lines: Sequence[str]) -> bool:
    """Whether the first line has this format's shape: many integers and nothing else but one voltage."""
    if not lines:
        return False
    fields = lines[0].split()
    return len(fields) >= FIRST_RANGE + BEAMS // 2 and all(
        field.replace(".", "", 1).lstrip("-").isdigit() for field in fields
    )


def read_mines(name: str, lines: Iterable[str]) -> RobotLog:
    """Parse the lines; `name` is the file's, for messages. Broken lines are left out and noted.

    Raises
    ------
    ThumperError
        Too many lines are cut off or have fields that are no numbers.
    """
    odometry = WheelOdometry(GEOMETRY)
    records: list[LogRecord] = []
    broken: list[str] = []
    for number, line in enumerate(lines, start=1):
        try:
            records.append(_record(line.split(), odometry))
        except ValueError as error:
            broken.append(f"line {number}: broken scan ({error})")
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
        time_increment_s=TURN_S / 1024,
        range_max_m=5.6,
    )
    # A line is written when the mirror has come round: the first beam left one turn earlier.
    twist = sample.twist
    odom_from_base = advance(sample.odom_from_base, -TURN_S * twist.v_m_s, -TURN_S * twist.w_rad_s)
    return LogRecord(time_s=time_s, odom_from_base=odom_from_base, twist=twist, scan=scan)
