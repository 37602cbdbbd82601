"""CARMEN text logs (.log, .clf): FLASER, ROBOTLASER, RAWLASER and RLASER lines, with ODOM and PARAM lines.

Format: the header that CARMEN's logger writes, and http://carmen.sourceforge.net/doc/binary__loggerplayback.html.
Logs differ in how they use it, so this reader checks every value against the rest of the log.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.lidar.scan import Scan
from thumper.odometry.pose_buffer import interpolate
from thumper.offline.carmen_lines import (
    FIELD_OF_VIEW_RAD,
    LaserLine,
    beam_angles,
    flaser,
    odom,
    rawlaser,
    robotlaser,
)
from thumper.offline.robot_log import (
    MAX_BROKEN_SHARE,
    NO_ODOMETRY,
    LogRecord,
    RobotLog,
    broken_note,
    refuse_fov,
)

FARTHEST_M = 150.0  # no scanner of such a log sees half of its beams end farther away
NO_RETURN_M = 80.0  # SICK scanners report 81.83 or 81.91 for "no return"
# Parsers of the laser lines. The first kind that a log contains is mapped.
LINES: dict[str, Callable[[list[str]], LaserLine]] = {
    "FLASER": flaser,
    "ROBOTLASER1": robotlaser,
    "ROBOTLASER0": robotlaser,
    "RAWLASER1": rawlaser,
    "RLASER": flaser,
}
OLD_LINES = ("FLASER", "RLASER")  # which do not contain their field of view
MAX_MOUNT_OFFSET_M = 2.0
MAX_FOV_RAD = math.tau + 0.01
SICK_BEAMS = (180, 181, 361, 401)  # certainly 180 degrees; 360 beams may cover 180 or 360 degrees


OdomLine = tuple[int, float, Pose2]  # number of the line, stamp [s], pose


@dataclass(slots=True, kw_only=True)
class _Lines:
    """The parsed lines of a log, by kind."""

    lasers: dict[str, list[LaserLine]] = field(default_factory=lambda: {keyword: [] for keyword in LINES})
    odometry: list[OdomLine] = field(default_factory=list)
    params: dict[str, str] = field(default_factory=dict)
    broken: list[str] = field(default_factory=list)


def recognizes(line: str, *, is_first: bool) -> bool:
    """Return whether the line starts with the keyword of a laser line; it may come late in a log."""
    del is_first
    return line.split(maxsplit=1)[0] in LINES


def read(name: str, lines: Iterable[str], fov_rad: float | None = None) -> RobotLog:
    """Parse the lines; `name` is the file, for messages. Uses one laser: the front one if there is one.

    `fov_rad` is the laser's field of view, for old laser lines, which do not contain it. Broken lines are
    dropped and noted.

    Raises
    ------
    ThumperError
        No laser line is valid, too many are broken, or `fov_rad` is given but the lines contain it.
    """
    parsed = _parse(lines)
    keyword = next((keyword for keyword in LINES if parsed.lasers[keyword]), "")
    scans = parsed.lasers.get(keyword, [])
    _check_scans(name, scans, parsed.broken)
    notes = [*broken_note(parsed.broken)]
    for other in LINES:
        if other != keyword and parsed.lasers[other]:
            notes.append(f"{len(parsed.lasers[other])} {other} lines not used: {keyword} is mapped")
    if keyword in OLD_LINES:
        fov_rad = fov_rad or _fov_parameter_rad(parsed.params, scans[0].ranges_m.size)
        scans = _with_angles(scans, fov_rad, notes)
    else:
        refuse_fov(name, fov_rad, f"a {keyword} line")
    _check_unit(name, scans)
    limit_m = _range_limit_m(scans, parsed.params)
    poses = [scan.odom_from_base for scan in scans]
    if not _moves(poses) and parsed.odometry:
        poses = _from_odom_lines(scans, parsed.odometry)
        notes.append("the laser lines contain no odometry; the ODOM lines are used")
    has_odometry = _moves(poses)
    if not has_odometry and len(scans) > 1:
        notes.append(NO_ODOMETRY)
    return RobotLog(
        format_name="CARMEN",
        base_from_laser=_mount(scans, keyword, parsed.params, notes),
        records=tuple(_record(scan, pose, limit_m) for scan, pose in zip(scans, poses, strict=True)),
        notes=tuple(notes),
        has_odometry=has_odometry,
    )


def _parse(lines: Iterable[str]) -> _Lines:
    parsed = _Lines()
    for number, line in enumerate(lines, start=1):
        fields = line.split()
        keyword = fields[0] if fields else ""
        try:
            if keyword == "PARAM" and len(fields) >= 3:
                parsed.params[fields[1]] = fields[2]
            elif keyword == "ODOM":
                parsed.odometry.append((number, *odom(fields)))
            elif keyword in LINES:
                parsed.lasers[keyword].append(replace(LINES[keyword](fields), number=number))
        except (ValueError, IndexError) as error:
            parsed.broken.append(f"line {number}: broken {keyword} ({error})")
    return parsed


def _check_scans(name: str, scans: list[LaserLine], broken: list[str]) -> None:
    """Raise ThumperError without scans, or with too many broken lines."""
    if scans and len(broken) <= max(1, MAX_BROKEN_SHARE * len(scans)):
        return
    if broken:
        raise ThumperError(
            f"{name}: {broken[0]}; the file may be cut off: copy it again", exit_code=EXIT_USAGE
        )
    raise ThumperError(
        f"{name}: no FLASER, ROBOTLASER1 or RAWLASER1 line in it; is it the right file?",
        exit_code=EXIT_USAGE,
    )


def _record(line: LaserLine, odom_from_base: Pose2, limit_m: float) -> LogRecord:
    # "No return" is neither a hit nor proof of free space: glass and black walls give it, too.
    limit_m = min(limit_m, line.range_max_m)
    ranges_m = line.ranges_m
    ranges_m[~(ranges_m > 0.0) | (ranges_m >= limit_m)] = np.nan  # in place: a log holds thousands
    scan = Scan(
        time_s=line.time_s,
        ranges_m=ranges_m,
        angle_min_rad=line.angle_min_rad,
        angle_increment_rad=line.angle_increment_rad,
        range_max_m=limit_m,
    )
    return LogRecord(time_s=line.time_s, odom_from_base=odom_from_base, twist=Twist2(), scan=scan)


def _fov_parameter_rad(params: dict[str, str], n: int) -> float | None:
    """Return the field of view of `n` beams from the log's PARAM lines, or None."""
    for key in ("robot_frontlaser_fov", "laser_front_laser_fov", "laser_laser1_fov"):
        fov = _parameter(params, key)
        # In degrees by CARMEN's rule, but some logs use radians. No laser sees less than 6.3 degrees.
        fov_rad = fov if fov <= MAX_FOV_RAD else math.radians(fov)
        if 0.0 < fov_rad <= MAX_FOV_RAD:
            return fov_rad
    for key in ("laser_front_laser_resolution", "laser_laser1_resolution"):
        fov_rad = math.radians(_parameter(params, key)) * (n - n % 2)
        if 0.0 < fov_rad <= MAX_FOV_RAD:
            return fov_rad
    return None


def _parameter(params: dict[str, str], key: str) -> float:
    """Return the parameter's value, or NaN."""
    try:
        return float(params.get(key, "nan"))
    except ValueError:
        return math.nan


def _with_angles(scans: list[LaserLine], fov_rad: float | None, notes: list[str]) -> list[LaserLine]:
    """Return old lines with this field of view. Without one, keep the default and note if it is a guess."""
    if fov_rad is None:
        n = scans[0].ranges_m.size
        if n not in FIELD_OF_VIEW_RAD and n not in SICK_BEAMS:
            notes.append(
                f"{n} beams without a field of view: 180 degrees assumed; to change it, pass --fov DEGREES"
            )
        return scans
    corrected = []
    for scan in scans:
        angle_min_rad, increment_rad = beam_angles(scan.ranges_m.size, fov_rad)
        corrected.append(replace(scan, angle_min_rad=angle_min_rad, angle_increment_rad=increment_rad))
    return corrected


def _check_unit(name: str, scans: list[LaserLine]) -> None:
    """Raise ThumperError if the ranges cannot be metres."""
    readings = np.concatenate([scan.ranges_m for scan in scans[:: max(1, len(scans) // 100)]])
    readings = readings[np.isfinite(readings) & (readings > 0.0)]
    if readings.size and np.median(readings) > FARTHEST_M:
        raise ThumperError(
            f"{name}: half of the beams are longer than {np.median(readings):.0f} m: the ranges are in "
            "millimetres; divide them by 1000",
            exit_code=EXIT_USAGE,
        )


def _range_limit_m(scans: list[LaserLine], params: dict[str, str]) -> float:
    """Return the reading that means "no return": from a PARAM line, or a spike at the largest reading."""
    readings_m = np.concatenate([scan.ranges_m for scan in scans[:: max(1, len(scans) // 500)]])
    readings_m = readings_m[np.isfinite(readings_m) & (readings_m < NO_RETURN_M)]
    limit_m = NO_RETURN_M
    for key in ("robot_frontlaser_max", "robot_front_laser_max", "laser_front_laser_max"):
        maximum_m = _parameter(params, key)
        if maximum_m > 1.0:
            limit_m = min(limit_m, maximum_m)
    if readings_m.size:
        top_m = float(readings_m.max())
        at_top = np.count_nonzero(readings_m >= 0.998 * top_m)
        below = np.count_nonzero((readings_m >= 0.978 * top_m) & (readings_m < 0.998 * top_m))
        if at_top > 20 + 5 * below:
            limit_m = min(limit_m, 0.998 * top_m)
    return limit_m


def _mount(scans: list[LaserLine], keyword: str, params: dict[str, str], notes: list[str]) -> Pose2:
    """Return `base_from_laser`: from the two poses of each line if they agree, else from PARAM lines."""
    is_rear = keyword == "RLASER"
    offset_m = _parameter(params, "robot_rearlaser_offset" if is_rear else "robot_frontlaser_offset")
    by_parameter = Pose2(
        x_m=offset_m if math.isfinite(offset_m) else 0.0, theta_rad=math.pi if is_rear else 0.0
    )
    if keyword == "RAWLASER1":
        return by_parameter  # these lines contain no poses
    offsets = [scan.odom_from_base.inverse() @ scan.odom_from_laser for scan in scans]
    table = np.array([(o.x_m, o.y_m, math.cos(o.theta_rad), math.sin(o.theta_rad)) for o in offsets])
    median = np.median(table, axis=0)
    deviation = float(np.quantile(np.abs(table - median).max(axis=1), 0.9))
    if deviation < 0.02 and math.hypot(median[0], median[1]) < MAX_MOUNT_OFFSET_M:
        return Pose2(x_m=float(median[0]), y_m=float(median[1]), theta_rad=math.atan2(median[3], median[2]))
    # Logs that a localizer has rewritten contain the laser's corrected pose instead.
    notes.append(
        "the laser's pose is not fixed to the robot's; its mounting is taken from PARAM lines or set to 0"
    )
    return by_parameter


def _moves(poses: list[Pose2]) -> bool:
    return any(pose != poses[0] for pose in poses[1:])


def _from_odom_lines(scans: list[LaserLine], odometry: list[OdomLine]) -> list[Pose2]:
    """Return the odometry at each laser line, interpolated between ODOM lines if the stamps allow it."""
    numbers = np.array([number for number, _, _ in odometry])
    poses = []
    for scan, after in zip(scans, np.searchsorted(numbers, [scan.number for scan in scans]), strict=True):
        _, before_s, pose = odometry[max(0, int(after) - 1)]
        if 0 < after < len(odometry):
            _, after_s, after_pose = odometry[int(after)]
            if before_s < scan.time_s < after_s:
                pose = interpolate(pose, after_pose, (scan.time_s - before_s) / (after_s - before_s))
        poses.append(pose)
    return poses
