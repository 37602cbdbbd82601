"""Replay a recorded run through the state estimator: the same inputs give the same map, bit for bit."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from thumper.board.gyroscope import GyroIncrements
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray
from thumper.config.robot import RobotConfig
from thumper.gps.earth_reference import EarthReference
from thumper.lidar.self_returns import SelfReturnFilter
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.recording.reader import RecordedMessage, Recording
from thumper.ros import from_ros
from thumper.ros.codec import Message
from thumper.ros.topics import TOPICS
from thumper.runtime.sensor_table import KINDS
from thumper.runtime.state_estimator import StateEstimator
from thumper.slam.factory import PathMapper, make_mapper

SENSORS = {kind.name: kind for kind in KINDS}


@dataclass(slots=True, kw_only=True)
class ReplayResult:
    """Result of a replay."""

    mapper: PathMapper
    scans: int = 0
    time_s: float = 0.0  # from the first telemetry to the last
    maps_recorded: int = 0  # published by the live run
    maps_identical: int = 0  # of them, equal to the replay's map at the same time in every cell
    unreadable: int = 0  # messages
    poses: list[tuple[float, float, float, float]] = field(default_factory=list)

    @property
    def path(self) -> FloatArray:
        """Columns time [s], x [m], y [m], heading [rad] in `map`, one row per telemetry; shape (n, 4)."""
        return np.array(self.poses, dtype=np.float64).reshape(-1, 4)


def replay(
    recording: Recording,
    config: RobotConfig | None = None,
    *,
    on_message: Callable[[RecordedMessage, Message], None] | None = None,
    speed: float = 0.0,
) -> ReplayResult:
    """Feed all sensors to a new state estimator, with the recorded configuration or another one.

    `on_message` is called with every message; `speed` is relative to real time, 0 for as fast as possible.

    Raises
    ------
    ThumperError
        Another program made the recording, or it has no wheels or no scans.
    """
    run = recording.run_metadata()
    if run is None:
        raise ThumperError(
            f"{recording.name}: another program made it; `thumper map-log` maps such files",
            exit_code=EXIT_USAGE,
        )
    robot = config or run.config
    base_from_laser = robot.lidar.base_from_laser
    mapper = make_mapper(robot.mapping, base_from_laser=base_from_laser, map_from_base=run.map_from_base)
    mapper.warm_up()
    estimator = StateEstimator(
        drive=robot.drive,
        base_from_laser=base_from_laser,
        mapper=mapper,
        imu=robot.imu,
        earth=EarthReference(robot.gps) if robot.gps.enabled else None,
        self_returns=SelfReturnFilter(base_from_laser, robot.footprint.polygon_m()),
    )
    gyro_increments = GyroIncrements()
    result = ReplayResult(mapper=mapper)
    compared_ns = -1
    comparable = run.from_start and config is None
    for recorded in _paced(recording.messages(), speed):
        if on_message is None and recorded.topic not in ("wheels", "scan", "map", *SENSORS):
            continue
        try:
            message = recorded.decode()
            if recorded.topic == "wheels":
                sample = from_ros.telemetry_of(message, run.epoch_ns)
                sample = replace(sample, gyro_increment_rad=gyro_increments.add(sample.telemetry))
                _add_pose(result, estimator)  # of the previous cycle, whose scans have been added since
                estimator.add_telemetry(sample)
            elif recorded.topic in SENSORS:
                kind = SENSORS[recorded.topic]
                kind.add(estimator, kind.sample_of(message, run.epoch_ns))
            elif recorded.topic == "scan":
                estimator.add_scan(from_ros.scan_of(message, run.epoch_ns))
            elif recorded.topic == "map" and comparable and from_ros.stamp_ns_of(message) != compared_ns:
                compared_ns = from_ros.stamp_ns_of(message)  # each file starts with a copy of the last map
                result.maps_recorded += 1
                result.maps_identical += _is_identical(from_ros.grid_of(message), mapper.grid())
        except (ValueError, KeyError):
            result.unreadable += 1
            continue
        if on_message is not None and recorded.topic in TOPICS:
            on_message(recorded, message)
    _add_pose(result, estimator)
    result.scans = estimator.scans_mapped
    if not result.scans:
        raise ThumperError(
            f"{recording.name}: it has no scan with odometry; was the lidar on?",
            exit_code=EXIT_USAGE,
        )
    result.time_s = result.poses[-1][0] - result.poses[0][0]
    return result


def _add_pose(result: ReplayResult, estimator: StateEstimator) -> None:
    state = estimator.state()
    if state is not None:
        pose = state.map_from_base
        result.poses.append((state.time_s, pose.x_m, pose.y_m, pose.theta_rad))


def _is_identical(one: OccupancyGrid, other: OccupancyGrid) -> bool:
    return (
        (one.resolution_m, one.origin_x_m, one.origin_y_m)
        == (other.resolution_m, other.origin_x_m, other.origin_y_m)
        and one.cells.shape == other.cells.shape
        and bool(np.array_equal(one.cells, other.cells))
    )


def _paced(messages: Iterator[RecordedMessage], speed: float) -> Iterator[RecordedMessage]:
    """Yield the messages, none before its time."""
    if speed <= 0.0:
        yield from messages
        return
    start_s, first_ns = time.monotonic(), None
    for recorded in messages:
        first_ns = recorded.log_ns if first_ns is None else first_ns
        ahead_s = 1e-9 * (recorded.log_ns - first_ns) / speed - (time.monotonic() - start_s)
        if ahead_s > 0.0:
            time.sleep(ahead_s)
        yield recorded
