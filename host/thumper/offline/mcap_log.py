"""MCAP recordings of ROS 2 robots, ours and others': a LaserScan topic, with Odometry or with transforms.

The odometry is interpolated to each scan's stamp; where the lidar sits comes from the transforms. Scans keep
their order in the file.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2, Twist2
from thumper.lidar.scan import Scan
from thumper.odometry.pose_buffer import interpolate
from thumper.offline.robot_log import NO_ODOMETRY, LogRecord, RobotLog, check_pose
from thumper.recording.reader import RecordedMessage, Recording
from thumper.ros import from_ros

SCAN, ODOMETRY, TRANSFORMS = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
BASES = ("base_link", "base_footprint", "base")
FARTHEST_S = 0.25  # from the nearest odometry, beyond which a scan has none of its own
CLOCK_SET_BACK_S = 1.0  # stamps that step back by more are of a clock that was set
LONGEST_CHAIN = 16  # transforms from base to lidar

Stamp = tuple[int, int]  # in the message's header, and when it was recorded [ns]
Track = list[tuple[int, Pose2]]  # stamp [ns] and odom_from_base
StampedTrack = list[tuple[Stamp, Pose2]]


@dataclass(slots=True, kw_only=True)
class _Found:
    scans: dict[str, list[tuple[Stamp, str, Scan]]] = field(default_factory=dict)  # with the frame
    odometry: dict[str, StampedTrack] = field(default_factory=dict)
    bases: dict[str, str] = field(default_factory=dict)  # of each odometry topic
    moving: dict[tuple[str, str], StampedTrack] = field(default_factory=dict)  # transforms, (parent, child)
    broken: int = 0


def read_mcap(path: Path) -> RobotLog:
    """Take the scan topic with the most scans, and the odometry topic with the most poses.

    Raises
    ------
    ThumperError
        The file cannot be read, or holds no scans.
    """
    recording = Recording((path,))
    found = _Found()
    for said in recording.messages():
        if said.type_name not in (SCAN, ODOMETRY, TRANSFORMS):
            continue
        try:
            _take(found, said)
        except ValueError:
            found.broken += 1
    if not found.scans:
        raise ThumperError(
            f"{path}: no LaserScan messages in it; is it the right file?", exit_code=EXIT_USAGE
        )
    notes = list(recording.notes)
    topic = max(found.scans, key=lambda name: len(found.scans[name]))
    notes += [f"{len(found.scans[name])} scans of {name} not used" for name in found.scans if name != topic]
    if found.broken:
        notes.append(f"{found.broken} broken messages left out")
    scans = found.scans[topic]
    stamps = np.array([stamp for stamp, _, _ in scans])
    clock = int(np.diff(stamps[:, 0]).min(initial=0) < -1e9 * CLOCK_SET_BACK_S)
    if clock:
        notes.append("the stamps step back: a clock was set; the times of recording are used")
    track, base = _track(found, clock)
    if not track:
        notes.append(NO_ODOMETRY)
    frame = Counter(frame for _, frame, _ in scans).most_common(1)[0][0]
    base_from_laser = _mount(found.moving, base, frame)
    if base_from_laser is None:
        notes.append(f"no transform from {base} to {frame}: the lidar is taken to sit at the robot's centre")
    records, alone = _records([(stamp[clock], scan) for stamp, _, scan in scans], track)
    if alone and track:
        notes.append(
            f"{alone} of {len(scans)} scans without odometry for their time: that before and after is used"
        )
    return RobotLog(
        format_name="MCAP",
        base_from_laser=base_from_laser or Pose2(),
        records=tuple(records),
        notes=tuple(notes),
        has_odometry=bool(track),
    )


def _take(found: _Found, said: RecordedMessage) -> None:
    message = said.decode()
    if said.type_name == SCAN:
        stamp = from_ros.stamp_ns_of(message), said.log_ns
        found.scans.setdefault(said.topic, []).append(
            (stamp, message.header.frame_id, from_ros.scan_of(message))
        )
    elif said.type_name == ODOMETRY:
        stamp = from_ros.stamp_ns_of(message), said.log_ns
        found.odometry.setdefault(said.topic, []).append(
            (stamp, check_pose(from_ros.pose_of(message.pose.pose)))
        )
        found.bases[said.topic] = message.child_frame_id
    else:
        for stamped in message.transforms:
            names = (stamped.header.frame_id.lstrip("/"), stamped.child_frame_id.lstrip("/"))
            stamp = from_ros.stamp_ns_of(stamped), said.log_ns
            found.moving.setdefault(names, []).append(
                (stamp, check_pose(from_ros.transform_of(stamped.transform)))
            )


def _track(found: _Found, clock: int) -> tuple[Track, str]:
    """The odometry in the order of time, empty if there is none, and the name of the frame that it moves."""
    poses: StampedTrack = []
    base = BASES[0]
    if found.odometry:
        topic = max(found.odometry, key=lambda name: len(found.odometry[name]))
        poses, base = found.odometry[topic], found.bases[topic].lstrip("/") or BASES[0]
    else:
        for (parent, child), moving in found.moving.items():
            if child in BASES and "odom" in parent:
                poses, base = moving, child
                break
    return sorted({stamp[clock]: pose for stamp, pose in poses}.items()), base


def _mount(moving: Mapping[tuple[str, str], StampedTrack], base: str, laser: str) -> Pose2 | None:
    """Go up from the lidar's frame until the base, along the newest transforms."""
    parents = {child: (parent, track[-1][1]) for (parent, child), track in moving.items()}
    frame, base_from_laser = laser.lstrip("/"), Pose2()
    for _ in range(LONGEST_CHAIN):
        if frame == base:
            return base_from_laser
        if frame not in parents:
            return None
        frame, parent_from_child = parents[frame]
        base_from_laser = parent_from_child @ base_from_laser
    return None


def _records(scans: list[tuple[int, Scan]], track: Track) -> tuple[list[LogRecord], int]:
    """One record a scan, and how many of them have no odometry near their time."""
    stamps = np.array([stamp for stamp, _ in track])
    first_ns = scans[0][0]
    records, alone = [], 0
    for stamp, scan in scans:
        turn_s = scan.time_increment_s * (scan.ranges_m.size - 1)
        start, near = _pose_at(stamp, stamps, track)
        end, _ = _pose_at(stamp + round(1e9 * turn_s), stamps, track)
        alone += not near
        time_s = 1e-9 * (stamp - first_ns)
        turned = start.inverse() @ end
        records.append(
            LogRecord(
                time_s=time_s,
                odom_from_base=start,
                twist=Twist2(v_m_s=turned.x_m / turn_s, w_rad_s=turned.theta_rad / turn_s)
                if turn_s > 0.0
                else Twist2(),
                scan=_usable(scan, time_s),
            )
        )
    return records, alone


def _pose_at(stamp: int, stamps: np.ndarray, track: Track) -> tuple[Pose2, bool]:
    """The odometry at a time, between two readings or the nearest one; and whether one is near."""
    if not track:
        return Pose2(), False
    index = int(np.searchsorted(stamps, stamp))
    if 0 < index < len(track):
        (before_ns, before), (after_ns, after) = track[index - 1], track[index]
        fraction = (stamp - before_ns) / (after_ns - before_ns)
        return interpolate(before, after, fraction), after_ns - before_ns <= 4e9 * FARTHEST_S
    nearest_ns, pose = track[min(index, len(track) - 1)]
    return pose, abs(nearest_ns - stamp) <= 1e9 * FARTHEST_S


def _usable(scan: Scan, time_s: float) -> Scan:
    """Drivers report "nothing seen" as 0 or as more than they can see: neither a hit nor free space."""
    ranges_m = scan.ranges_m
    wrong = (ranges_m < scan.range_min_m) | (np.isfinite(ranges_m) & (ranges_m > scan.range_max_m))
    return replace(scan, time_s=time_s, ranges_m=np.where(wrong, np.nan, ranges_m))
