"""The sensors beside board and lidar: how each is opened, fed to the state estimator and published."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from thumper.camera.frame import CameraFrame
from thumper.camera.open_camera import open_camera
from thumper.common.sensor import ReopenedSensor, Sensor
from thumper.config.robot import RobotConfig
from thumper.gps.fix import Fix
from thumper.gps.open_gps import open_gps
from thumper.imu.open_imu import open_imu
from thumper.imu.sample import ImuSample
from thumper.ros import from_ros
from thumper.ros.codec import Message
from thumper.ros.to_ros import Messages
from thumper.runtime.state_estimator import StateEstimator

Sample = TypeVar("Sample")

SILENT_S = 3.0  # a GPS receiver may send once per second


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorKind(Generic[Sample]):
    """A sensor; `name` is its table in the TOML, its topic, and its device in `sim://NAME/`."""

    name: str
    rate_Hz: float | None  # None: as it is set in the device
    is_wanted: Callable[[RobotConfig], bool]
    open: Callable[[RobotConfig], Sensor[Sample]]
    add: Callable[[StateEstimator, Sample], None]
    message: Callable[[Messages, Sample], Message]
    sample_of: Callable[[Message, int], Sample]  # from the message and its epoch [ns]
    publish_Hz: Callable[[RobotConfig], float] = lambda _config: (
        math.inf
    )  # samples above it are not published


IMU: SensorKind[ImuSample] = SensorKind(
    name="imu",
    rate_Hz=100.0,
    is_wanted=lambda config: config.imu.enabled and config.imu.model == "bno08x",  # else it is the board's
    open=lambda config: open_imu(config.imu),
    add=StateEstimator.add_imu,
    message=Messages.imu,
    sample_of=from_ros.imu_of,
)

GPS: SensorKind[Fix] = SensorKind(
    name="gps",
    rate_Hz=None,
    is_wanted=lambda config: config.gps.enabled,
    open=lambda config: open_gps(config.gps),
    add=StateEstimator.add_fix,
    message=Messages.fix,
    sample_of=from_ros.fix_of,
)

CAMERA: SensorKind[CameraFrame] = SensorKind(
    name="camera",
    rate_Hz=None,
    is_wanted=lambda config: config.camera.enabled,
    open=lambda config: open_camera(config.camera),
    add=StateEstimator.add_frame,
    message=Messages.image,
    sample_of=from_ros.frame_of,
    publish_Hz=lambda config: config.camera.publish_Hz,
)

KINDS: tuple[SensorKind[Any], ...] = (IMU, GPS, CAMERA)


@dataclass(slots=True, kw_only=True)
class SensorFeed:
    """An open sensor of the running robot, and its samples of the newest cycle."""

    kind: SensorKind[Any]
    sensor: ReopenedSensor[Any]
    samples: list[Any] = field(default_factory=list)
    newest: Any = None
    publish_Hz: float = math.inf
    _published_s: float = -math.inf

    def read(self, estimator: StateEstimator) -> None:
        """Pass on what has arrived."""
        self.samples = self.sensor.poll()
        for sample in self.samples:
            self.newest = sample
            self.kind.add(estimator, sample)

    def to_publish(self) -> list[Any]:
        """Return the samples of the newest cycle, without those above the rate to publish."""
        chosen = []
        for sample in self.samples:
            if sample.time_s >= self._published_s + 1.0 / self.publish_Hz:
                self._published_s = sample.time_s
                chosen.append(sample)
        return chosen

    def is_silent(self, now_s: float) -> bool:
        """Whether no sample has come for `SILENT_S`; not before the first one."""
        return self.newest is not None and now_s > self.newest.time_s + SILENT_S

    def summary(self, now_s: float) -> str:
        """Return name, samples, errors and restarts, and the fix of a GPS or how long it has been silent."""
        counters = self.sensor.counters
        errors = counters.bad_replies + counters.port_errors
        newest = f"; {self.newest.text}" if isinstance(self.newest, Fix) else ""
        if self.is_silent(now_s):
            newest = f"; no data for {now_s - self.newest.time_s:.0f} s: check its cable"
        count = f"{counters.samples} samples, {errors} errors, {counters.restarts} restarts"
        return f"{self.kind.name}: {count}{newest}"


def open_feed(kind: SensorKind[Any], config: RobotConfig) -> SensorFeed:
    """Open a sensor; raises ThumperError if it does not answer."""
    sensor = ReopenedSensor(kind.name, kind.open(config), lambda: kind.open(config))
    return SensorFeed(kind=kind, sensor=sensor, publish_Hz=kind.publish_Hz(config))
