"""A recorded run through the same perception again: the same inputs, hence the same map, bit by bit."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray
from thumper.config.robot import RobotConfig
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.recording.reader import RecordedMessage, Recording
from thumper.ros import from_ros
from thumper.ros.codec import Message
from thumper.ros.topics import TOPICS
from thumper.runtime.state_estimator import StateEstimator
from thumper.slam.factory import PathMapper, make_mapper


@dataclass(slots=True, kw_only=True)
class Replayed:
    """What came out."""

    mapper: PathMapper
    scans: int = 0
    time_s: float = 0.0  # from the first telemetry to the last
    maps_recorded: int = 0  # that the live run had published ...
    maps_same: int = 0  # ... and of them those that the replay had, cell by cell, at the same moment
    unreadable: int = 0  # messages
    poses: list[tuple[float, float, float, float]] = field(default_factory=list)

    @property
    def path(self) -> FloatArray:
        """Columns time [s], x [m], y [m], heading [rad] in `map`, a row a telemetry; shape (n, 4)."""
        return np.array(self.poses, dtype=np.float64).reshape(-1, 4)


def replay(
    recording: Recording,
    config: RobotConfig | None = None,
    *,
    on_said: Callable[[RecordedMessage, Message], None] | None = None,
    speed: float = 0.0,
) -> Replayed:
    """Feed wheels and scans to a new perception, with the recorded configuration or another one.

    `on_said` sees every message; `speed` is how many times faster than it was, 0 as fast as it goes.

    Raises
    ------
    ThumperError
        It is no recording of this program, or holds no wheels or no scans.
    """
    session = recording.session()
    if session is None:
        raise ThumperError(
            f"{recording.name}: recorded by another program; `thumper map-log` maps such files",
            exit_code=EXIT_USAGE,
        )
    used = config or session.config
    base_from_laser = used.lidar.base_from_laser
    mapper = make_mapper(used.mapping, base_from_laser=base_from_laser, map_from_base=session.map_from_base)
    mapper.warm_up()
    perception = StateEstimator(
        drive=used.drive, base_from_laser=base_from_laser, mapper=mapper, imu=used.imu
    )
    out = Replayed(mapper=mapper)
    compared_ns = -1
    comparable = session.from_start and config is None
    for said in _paced(recording.said(), speed):
        if on_said is None and said.topic not in ("wheels", "scan", "map"):
            continue
        try:
            message = said.message()
            if said.topic == "wheels":
                sample = from_ros.telemetry_of(message, session.epoch_ns)
                _note_pose(out, perception)  # of the beat before: its scans have come meanwhile
                perception.add_telemetry(sample)
            elif said.topic == "scan":
                perception.add_scan(from_ros.scan_of(message, session.epoch_ns))
            elif said.topic == "map" and comparable and from_ros.stamp_ns_of(message) != compared_ns:
                compared_ns = from_ros.stamp_ns_of(message)  # each new file begins with the map before it
                out.maps_recorded += 1
                out.maps_same += _same(from_ros.grid_of(message), mapper.grid())
        except (ValueError, KeyError):
            out.unreadable += 1
            continue
        if on_said is not None and said.topic in TOPICS:
            on_said(said, message)
    _note_pose(out, perception)
    out.scans = perception.scans_mapped
    if not out.scans:
        raise ThumperError(
            f"{recording.name}: no scan with the wheels' odometry in it; was the lidar on?",
            exit_code=EXIT_USAGE,
        )
    out.time_s = out.poses[-1][0] - out.poses[0][0]
    return out


def _note_pose(out: Replayed, perception: StateEstimator) -> None:
    situation = perception.state()
    if situation is not None:
        pose = situation.map_from_base
        out.poses.append((situation.time_s, pose.x_m, pose.y_m, pose.theta_rad))


def _same(one: OccupancyGrid, other: OccupancyGrid) -> bool:
    return (
        (one.resolution_m, one.origin_x_m, one.origin_y_m)
        == (other.resolution_m, other.origin_x_m, other.origin_y_m)
        and one.cells.shape == other.cells.shape
        and bool(np.array_equal(one.cells, other.cells))
    )


def _paced(said: Iterator[RecordedMessage], speed: float) -> Iterator[RecordedMessage]:
    """The same messages, each not before its time."""
    if speed <= 0.0:
        yield from said
        return
    start_s, first_ns = time.monotonic(), None
    for each in said:
        first_ns = each.log_ns if first_ns is None else first_ns
        ahead_s = 1e-9 * (each.log_ns - first_ns) / speed - (time.monotonic() - start_s)
        if ahead_s > 0.0:
            time.sleep(ahead_s)
        yield each
