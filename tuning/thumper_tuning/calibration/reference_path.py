"""The robot's true path: from the simulator, or from localization with a lidar."""

from importlib.metadata import entry_points
from urllib.parse import urlsplit

from thumper.board.board import TelemetrySample
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray
from thumper.config.robot import RobotConfig
from thumper.lidar.driver import LidarDriver
from thumper.lidar.self_returns import SelfReturnFilter
from thumper.runtime.state_estimator import StateEstimator
from thumper.slam.factory import make_mapper


def simulated_truth(board_url: str) -> FloatArray | None:
    """Return a simulated robot's ground truth so far (time, x, y, heading); None for a real robot."""
    parts = urlsplit(board_url)
    for plugin in entry_points(group="thumper.serial_protocols"):
        if plugin.name == parts.scheme:
            truth: FloatArray = plugin.load().simulation(parts.netloc).truth()
            return truth[:, :4]
    return None


class LidarReference:
    """Records the pose at each tick in the map that SLAM builds during the drive."""

    def __init__(self, config: RobotConfig, lidar: LidarDriver) -> None:
        base_from_laser = config.lidar.base_from_laser
        mapper = make_mapper(config.mapping, base_from_laser=base_from_laser)
        self._lidar = lidar
        self._estimator = StateEstimator(
            drive=config.drive,
            base_from_laser=base_from_laser,
            mapper=mapper,
            self_returns=SelfReturnFilter(base_from_laser, config.footprint.polygon_m()),
        )
        self.rows: list[tuple[float, float, float, float]] = []

    def add_sample(self, sample: TelemetrySample) -> None:
        """Process the counts, and all scans that have arrived."""
        self._estimator.add_telemetry(sample)
        for scan in self._lidar.poll():
            self._estimator.add_scan(scan)
        state = self._estimator.state()
        if state is not None:
            pose = state.map_from_base
            self.rows.append((state.time_s, pose.x_m, pose.y_m, pose.theta_rad))

    def check(self) -> None:
        """Raise `ThumperError` if no scan was mapped."""
        if self._estimator.scans_mapped == 0:
            raise ThumperError("the lidar sent no scan that could be mapped; check it with `thumper doctor`")
