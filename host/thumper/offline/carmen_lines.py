"""Parse single lines of a CARMEN log: laser lines and ODOM lines."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.offline.robot_log import check_pose

# Old laser lines do not contain their field of view. It is 180 degrees by convention, except
# for these numbers of beams.
FIELD_OF_VIEW_RAD = {
    541: math.radians(270.0),
    1081: math.radians(270.0),
    682: 681 * math.tau / 1024,  # Hokuyo URG: 1024 steps per revolution
    683: 682 * math.tau / 1024,
    726: 725 * math.tau / 1024,
    769: 768 * math.tau / 1024,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class LaserLine:
    """One scan as logged."""

    time_s: float
    odom_from_base: Pose2
    odom_from_laser: Pose2
    ranges_m: FloatArray
    angle_min_rad: float
    angle_increment_rad: float
    range_max_m: float
    number: int = 0


def flaser(fields: list[str]) -> LaserLine:
    """FLASER or RLASER n r1..rn laser(x y theta) odom(x y theta) ipc_timestamp host logger_timestamp"""
    n = int(fields[1])
    if n < 2 or len(fields) < n + 9:
        raise ValueError(f"{len(fields)} fields, {n + 9} expected")
    angle_min_rad, increment_rad = beam_angles(n, FIELD_OF_VIEW_RAD.get(n, math.pi))
    return LaserLine(
        time_s=float(fields[8 + n]),
        odom_from_base=_pose(fields[5 + n : 8 + n]),
        odom_from_laser=_pose(fields[2 + n : 5 + n]),
        ranges_m=np.array(fields[2 : 2 + n], dtype=np.float64),
        angle_min_rad=angle_min_rad,
        angle_increment_rad=increment_rad,
        range_max_m=math.inf,
    )


def beam_angles(n: int, fov_rad: float) -> tuple[float, float]:
    """Return the angle of the first beam and the step, for old lines: symmetric about straight ahead."""
    # An odd number of beams includes both ends of the field of view, an even number only the first.
    return -0.5 * fov_rad, fov_rad / (n - 1 if n % 2 or n in FIELD_OF_VIEW_RAD else n)


def robotlaser(fields: list[str]) -> LaserLine:
    """ROBOTLASER1 type start fov step max accuracy mode n r1..rn m s1..sm laser robot tv rv 3*safety stamp"""
    n = int(fields[8])
    after = 10 + n + int(fields[9 + n])
    if n < 2 or len(fields) < after + 12:
        raise ValueError(f"{len(fields)} fields, {after + 12} expected")
    return _with_header(
        fields,
        n,
        float(fields[after + 11]),
        _pose(fields[after + 3 : after + 6]),
        _pose(fields[after : after + 3]),
    )


def rawlaser(fields: list[str]) -> LaserLine:
    """RAWLASER1 type start fov step max accuracy mode n r1..rn m s1..sm ipc_timestamp host logger_stamp"""
    n = int(fields[8])
    after = 10 + n + int(fields[9 + n])
    if n < 2 or len(fields) <= after:
        raise ValueError(f"{len(fields)} fields, {after + 1} expected")
    return _with_header(fields, n, float(fields[after]), Pose2(), Pose2())


def odom(fields: list[str]) -> tuple[float, Pose2]:
    """ODOM x y theta tv rv accel ipc_timestamp host logger_timestamp"""
    return float(fields[7]) if len(fields) > 7 else math.nan, _pose(fields[1:4])


def _with_header(
    fields: list[str], n: int, time_s: float, odom_from_base: Pose2, odom_from_laser: Pose2
) -> LaserLine:
    """Build a line from the beams and the header that newer laser lines have."""
    start_rad, fov_rad, step_rad = (float(field) for field in fields[2:5])
    if step_rad == 0.0:
        step_rad = fov_rad / (n - 1)
    if not math.isfinite(start_rad) or not math.isfinite(step_rad) or step_rad == 0.0:
        raise ValueError("beams without directions")
    maximum_m = float(fields[5])
    return LaserLine(
        time_s=time_s,
        odom_from_base=odom_from_base,
        odom_from_laser=odom_from_laser,
        ranges_m=np.array(fields[9 : 9 + n], dtype=np.float64),
        angle_min_rad=start_rad,
        angle_increment_rad=step_rad,
        range_max_m=maximum_m if maximum_m > 0.0 else math.inf,
    )


def _pose(fields: list[str]) -> Pose2:
    x_m, y_m, theta_rad = (float(field) for field in fields)
    if not (math.isfinite(x_m) and math.isfinite(y_m) and math.isfinite(theta_rad)):
        raise ValueError("a pose that is not finite")
    return check_pose(Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad))
