"""Where the robot really was: from the simulator, or from a localised robot with a lidar."""

from importlib.metadata import entry_points
from urllib.parse import urlsplit

from thumper.board.board import TelemetrySample
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray
from thumper.config.robot import RobotConfig
from thumper.lidar.driver import LidarDriver
from thumper.runtime.state_estimator import StateEstimator
from thumper.slam.factory import make_mapper


def simulated_truth(board_url: str) -> FloatArray | None:
    """Ground truth so far of a simulated robot, columns time, x, y, heading; None for a real one."""
    parts = urlsplit(board_url)
    for plugin in entry_points(group="thumper.serial_protocols"):
        if plugin.name == parts.scheme:
            truth: FloatArray = plugin.load().simulation(parts.netloc).truth()
            return truth[:, :4]
    return None


class LidarReference:
    """The pose in the map that the robot builds on the way, noted at each tick."""

    def __init__(self, config: RobotConfig, lidar: LidarDriver) -> None:
        base_from_laser = config.lidar.base_from_laser
        mapper = make_mapper(config.mapping, base_from_laser=base_from_laser)
        self._lidar = lidar
        self._perception = StateEstimator(drive=config.drive, base_from_laser=base_from_laser, mapper=mapper)
        self.rows: list[tuple[float, float, float, float]] = []

    def tick(self, sample: TelemetrySample) -> None:
        """Take the counts and the scans that have come."""
        self._perception.add_telemetry(sample)
        for scan in self._lidar.poll():
            self._perception.add_scan(scan)
        situation = self._perception.state()
        if situation is not None:
            pose = situation.map_from_base
            self.rows.append((situation.time_s, pose.x_m, pose.y_m, pose.theta_rad))

    def check(self) -> None:
        """Raise `ThumperError` unless scans were mapped."""
        if self._perception.scans_mapped == 0:
            raise ThumperError("the lidar sent no scan that could be mapped; `thumper doctor` looks into it")
