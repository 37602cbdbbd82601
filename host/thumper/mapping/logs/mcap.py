"""MCAP recordings of ROS 2 robots, ours and others': a LaserScan topic, with Odometry or with transforms.

The odometry is interpolated to each scan's stamp; where the lidar sits comes from the transforms.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from thumper.errors import ThumperError
from thumper.geometry import Pose2, Twist2
from thumper.lidar.scan import Scan
from thumper.mapping.logs.record import LogRecord, RobotLog
from thumper.odometry.history import interpolate
from thumper.recording.reader import Recording
from thumper.ros import parse
from thumper.ros.codec import Message

SCAN, ODOMETRY, TRANSFORMS = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
BASES = ("base_link", "base_footprint", "base")
FARTHEST_S = 0.25  # from the nearest odometry, beyond which a scan is left out
LONGEST_CHAIN = 16  # transforms from base to lidar

Track = list[tuple[int, Pose2]]  # stamp [ns] and odom_from_base


@dataclass(slots=True, kw_only=True)
class _Found:
    scans: dict[str, list[tuple[int, str, Scan]]] = field(default_factory=dict)  # stamp, frame
    odometry: dict[str, Track] = field(default_factory=dict)
    bases: dict[str, str] = field(default_factory=dict)  # of each odometry topic
    moving: dict[tuple[str, str], Track] = field(default_factory=dict)  # transforms by (parent, child)
    broken: int = 0


def read_mcap(path: Path) -> RobotLog:
    """Take the scan topic with the most scans, and the odometry topic with the most poses.

    Raises
    ------
    ThumperError
        The file cannot be read, or holds no scans or no odometry.
    """
    recording = Recording((path,))
    found = _Found()
    for said in recording.said():
        if said.type_name not in (SCAN, ODOMETRY, TRANSFORMS):
            continue
        try:
            _take(found, said.topic, said.type_name, said.message())
        except ValueError:
            found.broken += 1
    if not found.scans:
        raise ThumperError(f"{path}: no LaserScan messages in it; is it the right file?", exit_code=2)
    notes = list(recording.notes)
    topic = max(found.scans, key=lambda name: len(found.scans[name]))
    notes += [f"{len(found.scans[name])} scans of {name} not used" for name in found.scans if name != topic]
    if found.broken:
        notes.append(f"{found.broken} broken messages left out")
    track, base = _track(found, path)
    scans = sorted(found.scans[topic], key=lambda entry: entry[0])
    frame = Counter(frame for _, frame, _ in scans).most_common(1)[0][0]
    base_from_laser = _mount(found.moving, base, frame)
    if base_from_laser is None:
        notes.append(f"no transform from {base} to {frame}: the lidar is taken to sit at the robot's centre")
    records = _records(scans, track)
    if not records:
        raise ThumperError(f"{path}: its odometry and its scans are of different times", exit_code=2)
    if len(records) < len(scans):
        notes.append(f"{len(scans) - len(records)} scans without odometry left out")
    return RobotLog(
        format_name="MCAP",
        base_from_laser=base_from_laser or Pose2(),
        records=tuple(records),
        notes=tuple(notes),
    )


def _take(found: _Found, topic: str, type_name: str, message: Message) -> None:
    if type_name == SCAN:
        entry = (parse.stamp_ns_of(message), message.header.frame_id, parse.scan_of(message))
        found.scans.setdefault(topic, []).append(entry)
    elif type_name == ODOMETRY:
        pose = parse.pose_of(message.pose.pose)
        found.odometry.setdefault(topic, []).append((parse.stamp_ns_of(message), pose))
        found.bases[topic] = message.child_frame_id
    else:
        for stamped in message.transforms:
            names = (stamped.header.frame_id.lstrip("/"), stamped.child_frame_id.lstrip("/"))
            at = parse.transform_of(stamped.transform)
            found.moving.setdefault(names, []).append((parse.stamp_ns_of(stamped), at))


def _track(found: _Found, path: Path) -> tuple[Track, str]:
    """The odometry in the order of time, and the name of the frame that it moves."""
    if found.odometry:
        topic = max(found.odometry, key=lambda name: len(found.odometry[name]))
        track, base = found.odometry[topic], found.bases[topic].lstrip("/") or BASES[0]
    else:
        for (parent, child), poses in found.moving.items():
            if child in BASES and "odom" in parent:
                track, base = poses, child
                break
        else:
            raise ThumperError(f"{path}: neither Odometry nor transforms of it; is it recorded?", exit_code=2)
    return sorted(dict(track).items()), base


def _mount(moving: Mapping[tuple[str, str], Track], base: str, laser: str) -> Pose2 | None:
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


def _records(scans: list[tuple[int, str, Scan]], track: Track) -> list[LogRecord]:
    stamps = np.array([stamp for stamp, _ in track])
    first_ns = scans[0][0]
    records = []
    for stamp, _, scan in scans:
        turn_s = scan.time_increment_s * (scan.ranges_m.size - 1)
        start = _pose_at(stamp, stamps, track)
        end = _pose_at(stamp + round(1e9 * turn_s), stamps, track)
        if start is None:
            continue
        time_s = 1e-9 * (stamp - first_ns)
        turned = start.inverse() @ end if end else Pose2()
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
    return records


def _pose_at(stamp: int, stamps: np.ndarray, track: Track) -> Pose2 | None:
    """The odometry at a time, between two readings or at the nearest one if that is near enough."""
    index = int(np.searchsorted(stamps, stamp))
    if 0 < index < len(track):
        (before_ns, before), (after_ns, after) = track[index - 1], track[index]
        if after_ns - before_ns <= 4e9 * FARTHEST_S:
            return interpolate(before, after, (stamp - before_ns) / (after_ns - before_ns))
    nearest = min((max(index - 1, 0), min(index, len(track) - 1)), key=lambda k: abs(track[k][0] - stamp))
    return track[nearest][1] if abs(track[nearest][0] - stamp) <= 1e9 * FARTHEST_S else None


def _usable(scan: Scan, time_s: float) -> Scan:
    """Drivers report "nothing seen" as 0 or as more than they can see: neither a hit nor free space."""
    ranges_m = scan.ranges_m
    wrong = (ranges_m < scan.range_min_m) | (np.isfinite(ranges_m) & (ranges_m > scan.range_max_m))
    return replace(scan, time_s=time_s, ranges_m=np.where(wrong, np.nan, ranges_m))
