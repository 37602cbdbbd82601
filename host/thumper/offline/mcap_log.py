"""MCAP recordings of ROS 2 robots, by Thumper or others: a LaserScan topic, and Odometry or transforms.

The odometry is interpolated to each scan's stamp. The lidar's mounting comes from the transforms. Scans keep
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
MAX_ODOMETRY_GAP_S = 0.25  # a scan further away from the nearest odometry has none of its own
CLOCK_SET_BACK_S = 1.0  # stamps that step back by more mean that a clock was set
LONGEST_CHAIN = 16  # transforms from base to lidar

Stamp = tuple[int, int]  # from the message's header, and the time of recording [ns]
StampedTrack = list[tuple[Stamp, Pose2]]


@dataclass(slots=True, kw_only=True)
class _Messages:
    """The messages of a recording, by kind."""

    scans: dict[str, list[tuple[Stamp, str, Scan]]] = field(default_factory=dict)  # with the frame
    odometry: dict[str, StampedTrack] = field(default_factory=dict)
    bases: dict[str, str] = field(default_factory=dict)  # base frame of each odometry topic
    transforms: dict[tuple[str, str], StampedTrack] = field(default_factory=dict)  # by (parent, child)
    broken: int = 0


class _Track:
    """Odometry in the order of time: stamps [ns] and `odom_from_base`."""

    def __init__(self, poses: dict[int, Pose2]) -> None:
        self._items = sorted(poses.items())
        self._stamps = np.array([stamp for stamp, _ in self._items])

    def __bool__(self) -> bool:
        return bool(self._items)

    def at(self, stamp: int) -> tuple[Pose2, bool]:
        """Return the pose, interpolated or the nearest one, and whether odometry is near that time."""
        if not self._items:
            return Pose2(), False
        index = int(np.searchsorted(self._stamps, stamp))
        if 0 < index < len(self._items):
            (before_ns, before), (after_ns, after) = self._items[index - 1], self._items[index]
            fraction = (stamp - before_ns) / (after_ns - before_ns)
            return interpolate(before, after, fraction), after_ns - before_ns <= 4e9 * MAX_ODOMETRY_GAP_S
        nearest_ns, pose = self._items[min(index, len(self._items) - 1)]
        return pose, abs(nearest_ns - stamp) <= 1e9 * MAX_ODOMETRY_GAP_S


def read_mcap(path: Path) -> RobotLog:
    """Read the scan topic with the most scans and the odometry topic with the most poses.

    Raises
    ------
    ThumperError
        The file cannot be read, or contains no scans.
    """
    recording = Recording((path,))
    messages = _collect(recording)
    if not messages.scans:
        raise ThumperError(
            f"{path}: no LaserScan messages in it; is it the right file?", exit_code=EXIT_USAGE
        )
    notes = list(recording.notes)
    topic = max(messages.scans, key=lambda name: len(messages.scans[name]))
    notes += [
        f"{len(messages.scans[name])} scans of {name} not used" for name in messages.scans if name != topic
    ]
    if messages.broken:
        notes.append(f"{messages.broken} broken messages dropped")
    scans = messages.scans[topic]
    stamps = np.array([stamp for stamp, _, _ in scans])
    clock = int(np.diff(stamps[:, 0]).min(initial=0) < -1e9 * CLOCK_SET_BACK_S)
    if clock:
        notes.append("the stamps step back because a clock was set; the times of recording are used")
    track, base = _odometry(messages, clock)
    if not track:
        notes.append(NO_ODOMETRY)
    frame = Counter(frame for _, frame, _ in scans).most_common(1)[0][0]
    base_from_laser = _mount(messages.transforms, base, frame)
    if base_from_laser is None:
        notes.append(f"no transform from {base} to {frame}: the lidar is assumed at the robot's centre")
    records, unmatched = _records([(stamp[clock], scan) for stamp, _, scan in scans], track)
    if unmatched and track:
        notes.append(
            f"{unmatched} of {len(scans)} scans without odometry for their time: the nearest one is used"
        )
    return RobotLog(
        format_name="MCAP",
        base_from_laser=base_from_laser or Pose2(),
        records=tuple(records),
        notes=tuple(notes),
        has_odometry=bool(track),
    )


def _collect(recording: Recording) -> _Messages:
    """Decode all messages of the types that a log needs."""
    messages = _Messages()
    for recorded in recording.messages():
        if recorded.type_name not in (SCAN, ODOMETRY, TRANSFORMS):
            continue
        try:
            _add(messages, recorded)
        except ValueError:
            messages.broken += 1
    return messages


def _add(messages: _Messages, recorded: RecordedMessage) -> None:
    message = recorded.decode()
    if recorded.type_name == SCAN:
        stamp = from_ros.stamp_ns_of(message), recorded.log_ns
        messages.scans.setdefault(recorded.topic, []).append(
            (stamp, message.header.frame_id, from_ros.scan_of(message))
        )
    elif recorded.type_name == ODOMETRY:
        stamp = from_ros.stamp_ns_of(message), recorded.log_ns
        messages.odometry.setdefault(recorded.topic, []).append(
            (stamp, check_pose(from_ros.pose_of(message.pose.pose)))
        )
        messages.bases[recorded.topic] = message.child_frame_id
    else:
        for stamped in message.transforms:
            names = (stamped.header.frame_id.lstrip("/"), stamped.child_frame_id.lstrip("/"))
            stamp = from_ros.stamp_ns_of(stamped), recorded.log_ns
            messages.transforms.setdefault(names, []).append(
                (stamp, check_pose(from_ros.transform_of(stamped.transform)))
            )


def _odometry(messages: _Messages, clock: int) -> tuple[_Track, str]:
    """Return the odometry, which may be empty, and the name of its base frame."""
    poses: StampedTrack = []
    base = BASES[0]
    if messages.odometry:
        topic = max(messages.odometry, key=lambda name: len(messages.odometry[name]))
        poses, base = messages.odometry[topic], messages.bases[topic].lstrip("/") or BASES[0]
    else:
        for (parent, child), track in messages.transforms.items():
            if child in BASES and "odom" in parent:
                poses, base = track, child
                break
    return _Track({stamp[clock]: pose for stamp, pose in poses}), base


def _mount(transforms: Mapping[tuple[str, str], StampedTrack], base: str, laser: str) -> Pose2 | None:
    """Return `base_from_laser` along the newest transforms from the lidar up to the base, or None."""
    parents = {child: (parent, track[-1][1]) for (parent, child), track in transforms.items()}
    frame, base_from_laser = laser.lstrip("/"), Pose2()
    for _ in range(LONGEST_CHAIN):
        if frame == base:
            return base_from_laser
        if frame not in parents:
            return None
        frame, parent_from_child = parents[frame]
        base_from_laser = parent_from_child @ base_from_laser
    return None


def _records(scans: list[tuple[int, Scan]], track: _Track) -> tuple[list[LogRecord], int]:
    """Return one record per scan, and how many scans have no odometry near their time."""
    first_ns = scans[0][0]
    records, unmatched = [], 0
    for stamp, scan in scans:
        duration_s = scan.time_increment_s * (scan.ranges_m.size - 1)
        start, is_near = track.at(stamp)
        end, _ = track.at(stamp + round(1e9 * duration_s))
        unmatched += not is_near
        time_s = 1e-9 * (stamp - first_ns)
        motion = start.inverse() @ end
        records.append(
            LogRecord(
                time_s=time_s,
                odom_from_base=start,
                twist=Twist2(v_m_s=motion.x_m / duration_s, w_rad_s=motion.theta_rad / duration_s)
                if duration_s > 0.0
                else Twist2(),
                scan=_with_invalid_ranges(scan, time_s),
            )
        )
    return records, unmatched


def _with_invalid_ranges(scan: Scan, time_s: float) -> Scan:
    """Set ranges outside the sensor's limits to NaN: drivers use them for "no return"."""
    ranges_m = scan.ranges_m
    wrong = (ranges_m < scan.range_min_m) | (np.isfinite(ranges_m) & (ranges_m > scan.range_max_m))
    return replace(scan, time_s=time_s, ranges_m=np.where(wrong, np.nan, ranges_m))
