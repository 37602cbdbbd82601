"""CARMEN text logs (.log, .clf): FLASER, ROBOTLASER, RAWLASER and RLASER lines, with ODOM and PARAM lines.

Format: the header that CARMEN's logger writes, and http://carmen.sourceforge.net/doc/binary__loggerplayback.html.
Logs differ: every reading is checked against the rest of its log rather than trusted.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace

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

NO_RETURN_M = 80.0  # SICK scanners report 81.83 or 81.91 for "nothing came back", whatever the reason
# How to read each laser's lines; the first kind that a log has is mapped.
LINES: dict[str, Callable[[list[str]], LaserLine]] = {
    "FLASER": flaser,
    "ROBOTLASER1": robotlaser,
    "ROBOTLASER0": robotlaser,
    "RAWLASER1": rawlaser,
    "RLASER": flaser,
}
OLD_LINES = ("FLASER", "RLASER")  # which do not tell their field of view
FARTHEST_MOUNT_M = 2.0
MOST_RADIANS = math.tau + 0.01
HALF_TURN_BEAMS = (180, 181, 361, 401)  # a SICK's, beyond doubt; 360 may be a half turn or a whole one


OdomLine = tuple[int, float, Pose2]  # number of the line, stamp [s], pose


def is_carmen(lines: Iterable[str]) -> bool:
    """Whether a line starts with a keyword that this reader understands."""
    return any(line.split(maxsplit=1)[0] in LINES for line in lines if line.strip())


def read_carmen(name: str, lines: Iterable[str], fov_rad: float | None = None) -> RobotLog:
    """Parse the lines; `name` is the file's, for messages. One laser is used: the front one if there is one.

    `fov_rad` is the laser's field of view, for old laser lines, which do not tell it.

    Broken lines are left out and counted in the log's notes.

    Raises
    ------
    ThumperError
        No laser line can be read, too many are broken, or `fov_rad` is given though they tell it themselves.
    """
    lasers: dict[str, list[LaserLine]] = {keyword: [] for keyword in LINES}
    odometry: list[OdomLine] = []
    params: dict[str, str] = {}
    broken: list[str] = []
    for number, line in enumerate(lines, start=1):
        fields = line.split()
        keyword = fields[0] if fields else ""
        try:
            if keyword == "PARAM" and len(fields) >= 3:
                params[fields[1]] = fields[2]
            elif keyword == "ODOM":
                odometry.append((number, *odom(fields)))
            elif keyword in LINES:
                lasers[keyword].append(replace(LINES[keyword](fields), number=number))
        except (ValueError, IndexError) as error:
            broken.append(f"line {number}: broken {keyword} ({error})")
    used = next((keyword for keyword in LINES if lasers[keyword]), "")
    scans = lasers.get(used, [])
    if not scans or len(broken) > max(1, MAX_BROKEN_SHARE * len(scans)):
        if broken:
            raise ThumperError(
                f"{name}: {broken[0]}; the file may be cut off: copy it again", exit_code=EXIT_USAGE
            )
        raise ThumperError(
            f"{name}: no FLASER, ROBOTLASER1 or RAWLASER1 line in it; is it the right file?",
            exit_code=EXIT_USAGE,
        )
    notes = [*broken_note(broken)]
    for other in LINES:
        if other != used and lasers[other]:
            notes.append(f"{len(lasers[other])} {other} lines not used: {used} is mapped")
    if used in OLD_LINES:
        scans = _with_angles(scans, fov_rad or _named_fov_rad(params, scans[0].ranges_m.size), notes)
    else:
        refuse_fov(name, fov_rad, f"a {used} line")
    limit_m = _range_limit_m(scans, params)
    poses = [scan.odom_from_base for scan in scans]
    if not _moves(poses) and odometry:
        poses = _from_odom_lines(scans, odometry)
        notes.append("the laser lines hold no odometry; the ODOM lines are used")
    has_odometry = _moves(poses)
    if not has_odometry and len(scans) > 1:
        notes.append(NO_ODOMETRY)
    return RobotLog(
        format_name="CARMEN",
        base_from_laser=_mount(scans, used, params, notes),
        records=tuple(_record(scan, pose, limit_m) for scan, pose in zip(scans, poses, strict=True)),
        notes=tuple(notes),
        has_odometry=has_odometry,
    )


def _record(line: LaserLine, odom_from_base: Pose2, limit_m: float) -> LogRecord:
    # "No return" is neither a hit nor proof of free space: glass and black walls look like that too.
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


def _named_fov_rad(params: dict[str, str], n: int) -> float | None:
    """The field of view of `n` beams that the log's own parameters name; none if they do not."""
    for key in ("robot_frontlaser_fov", "laser_front_laser_fov", "laser_laser1_fov"):
        named = _number(params, key)
        # Degrees by CARMEN's rule, but some logs hold radians; no laser sees less than 6.3 degrees.
        named_rad = named if named <= MOST_RADIANS else math.radians(named)
        if 0.0 < named_rad <= MOST_RADIANS:
            return named_rad
    for key in ("laser_front_laser_resolution", "laser_laser1_resolution"):
        named_rad = math.radians(_number(params, key)) * (n - n % 2)
        if 0.0 < named_rad <= MOST_RADIANS:
            return named_rad
    return None


def _number(params: dict[str, str], key: str) -> float:
    try:
        return float(params.get(key, "nan"))
    except ValueError:
        return math.nan


def _with_angles(scans: list[LaserLine], fov_rad: float | None, notes: list[str]) -> list[LaserLine]:
    """Old lines with the field of view that is known; where only their number of beams speaks, a note."""
    if fov_rad is None:
        n = scans[0].ranges_m.size
        if n not in FIELD_OF_VIEW_RAD and n not in HALF_TURN_BEAMS:
            notes.append(f"{n} beams without a field of view: taken as half a turn; else give --fov DEGREES")
        return scans
    found = []
    for scan in scans:
        angle_min_rad, increment_rad = beam_angles(scan.ranges_m.size, fov_rad)
        found.append(replace(scan, angle_min_rad=angle_min_rad, angle_increment_rad=increment_rad))
    return found


def _range_limit_m(scans: list[LaserLine], params: dict[str, str]) -> float:
    """The reading that means "nothing came back": named by the log, or a spike at the largest reading."""
    readings_m = np.concatenate([scan.ranges_m for scan in scans[:: max(1, len(scans) // 500)]])
    readings_m = readings_m[np.isfinite(readings_m) & (readings_m < NO_RETURN_M)]
    limit_m = NO_RETURN_M
    for key in ("robot_frontlaser_max", "robot_front_laser_max", "laser_front_laser_max"):
        named_m = _number(params, key)
        if named_m > 1.0:
            limit_m = min(limit_m, named_m)
    if readings_m.size:
        top_m = float(readings_m.max())
        at_top = np.count_nonzero(readings_m >= 0.998 * top_m)
        below = np.count_nonzero((readings_m >= 0.978 * top_m) & (readings_m < 0.998 * top_m))
        if at_top > 20 + 5 * below:
            limit_m = min(limit_m, 0.998 * top_m)
    return limit_m


def _mount(scans: list[LaserLine], used: str, params: dict[str, str], notes: list[str]) -> Pose2:
    """Where the laser sits: from the two poses of each line, if they are steady and near each other."""
    offset_m = _number(params, "robot_rearlaser_offset" if used == "RLASER" else "robot_frontlaser_offset")
    named = Pose2(
        x_m=offset_m if math.isfinite(offset_m) else 0.0, theta_rad=math.pi if used == "RLASER" else 0.0
    )
    offsets = [scan.odom_from_base.inverse() @ scan.odom_from_laser for scan in scans]
    if used == "RAWLASER1":
        return named  # these lines hold no poses
    table = np.array([(o.x_m, o.y_m, math.cos(o.theta_rad), math.sin(o.theta_rad)) for o in offsets])
    middle = np.median(table, axis=0)
    spread = float(np.quantile(np.abs(table - middle).max(axis=1), 0.9))
    if spread < 0.02 and math.hypot(middle[0], middle[1]) < FARTHEST_MOUNT_M:
        return Pose2(x_m=float(middle[0]), y_m=float(middle[1]), theta_rad=math.atan2(middle[3], middle[2]))
    # Logs that a localiser has written over hold the laser's corrected pose instead.
    notes.append(
        "the laser's pose is not fixed to the robot's; its mounting is taken from PARAM lines or as 0"
    )
    return named


def _moves(poses: list[Pose2]) -> bool:
    return any(pose != poses[0] for pose in poses[1:])


def _from_odom_lines(scans: list[LaserLine], odometry: list[OdomLine]) -> list[Pose2]:
    """The odometry of each laser line: between the ODOM lines before and after it, if stamps tell where."""
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
