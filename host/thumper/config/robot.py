"""Read the robot's TOML and check every key, type and range. Unknown keys are errors."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any
from urllib.parse import urlsplit

from annotated_types import Gt, Le
from pydantic import StringConstraints, TypeAdapter

from thumper.board.options import BoardOptions
from thumper.camera.dock_options import DockOptions
from thumper.camera.options import CameraOptions
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.kinematics import DriveGeometry
from thumper.common.strict_toml import Renamed, read_checked, with_new_names
from thumper.config.bus import ROBOT_NAME_PATTERN, BusOptions
from thumper.config.dashboard import DashboardOptions
from thumper.config.manual_drive import ManualDriveOptions
from thumper.config.own_simulation import own_simulation
from thumper.config.recording import RecordingOptions
from thumper.config.ros import RosOptions
from thumper.config.teleop import TeleopOptions
from thumper.gps.options import GpsOptions
from thumper.imu.options import ImuOptions
from thumper.lidar.options import LidarOptions
from thumper.navigation.footprint import Footprint
from thumper.navigation.options import NavigationOptions
from thumper.navigation.registry import check_names
from thumper.slam.factory import OLD_METHODS, MappingOptions
from thumper.slam.localization.options import AmclOptions

SENSOR_TABLES = ("imu", "gps", "camera")  # of the sensors that have a port of their own, beside the lidar


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveOptions(DriveGeometry):
    """Geometry of the drive, and the highest wheel speed to command."""

    max_wheel_rad_s: Annotated[float, Gt(0), Le(17)] = 13.0  # highest wheel speed to command
    stated: tuple[str, ...] = field(default=(), compare=False)
    """Keys that the file sets, even to their defaults; not a key itself. The board supplies the others."""

    def states(self, key: str) -> bool:
        """Return whether the value of `key` is the robot's own, and not just the default."""
        return key in self.stated or getattr(self, key) != getattr(DriveGeometry(), key)


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotConfig:
    """The whole configuration of one robot; the defaults are the Wild Thumper's."""

    # Name of the robot: letters, digits, - and _. Part of the bus's keys and of recordings' file names.
    name: Annotated[str, StringConstraints(pattern=ROBOT_NAME_PATTERN)] = "thumper"
    board: BoardOptions = field(default_factory=BoardOptions)
    lidar: LidarOptions = field(default_factory=LidarOptions)
    drive: DriveOptions = field(default_factory=DriveOptions)
    imu: ImuOptions = field(default_factory=ImuOptions)
    gps: GpsOptions = field(default_factory=GpsOptions)
    camera: CameraOptions = field(default_factory=CameraOptions)
    dock: DockOptions = field(default_factory=DockOptions)
    mapping: MappingOptions = field(default_factory=MappingOptions)
    localization: AmclOptions = field(default_factory=AmclOptions)
    footprint: Footprint = field(default_factory=Footprint)
    navigation: NavigationOptions = field(default_factory=NavigationOptions)
    service: ManualDriveOptions = field(default_factory=ManualDriveOptions)
    bus: BusOptions = field(default_factory=BusOptions)
    ros: RosOptions = field(default_factory=RosOptions)
    dashboard: DashboardOptions = field(default_factory=DashboardOptions)
    recording: RecordingOptions = field(default_factory=RecordingOptions)
    teleop: TeleopOptions = field(default_factory=TeleopOptions)


# Keys and tables of earlier versions: the full key, and how "KEY was removed: it ..." goes on. Append here
# what you remove, so that an old file is refused with the reason and the fix.
REMOVED_KEYS: Mapping[str, str] = MappingProxyType(
    {
        "bus.rosbridge_port": "was the port of rosbridge; use `thumper ros` or `thumper foxglove` and "
        "delete the key",
        "navigation.astar": "has moved to navigation.traversal; smoothing_rounds is fixed at 30",
        "navigation.cascade.along_gain": "is fixed at 1.0; delete the key",
        "navigation.cascade.damping": "is fixed at 1.0; delete the key",
        "navigation.cascade.turn_end_rad": "has moved to navigation.rotate_in_place.turn_end_rad",
        "navigation.cascade.turn_part": "is fixed at 0.7; delete the key",
        "navigation.cascade.turn_start_rad": "has moved to navigation.rotate_in_place.turn_start_rad",
        "navigation.costmap.trust_m": "is fixed at 0.08 m; delete the key",
        "navigation.dwa.contact_weight": "is fixed at 0.5; delete the key",
        "navigation.dwa.front_m": "is fixed at 0.25 m; delete the key",
        "navigation.dwa.front_weight": "is fixed at 0.7; delete the key",
        "navigation.dwa.obstacle_decay_m": "is fixed at 0.08 m; delete the key",
        "navigation.dwa.oscillation_m": "is fixed at 0.05 m; delete the key",
        "navigation.dwa.oscillation_rad": "is fixed at 0.2 rad; delete the key",
        "navigation.dwa.smooth_weight": "is fixed at 0.02; delete the key",
        "navigation.dwa.step_s": "is fixed at 0.1 s; delete the key",
        "navigation.dwa.turn_end_rad": "has moved to navigation.rotate_in_place.turn_end_rad",
        "navigation.dwa.turn_start_rad": "has moved to navigation.rotate_in_place.turn_start_rad",
        "navigation.lattice.allow_unknown": "has moved to navigation.traversal.allow_unknown",
        "navigation.lattice.escape_radius_m": "has moved to navigation.traversal.escape_radius_m",
        "navigation.lattice.greed": "is fixed at 1.2; delete the key",
        "navigation.lattice.most_poses": "is fixed at 200000; delete the key",
        "navigation.lattice.obstacle_weight": "has moved to navigation.traversal.obstacle_weight",
        "navigation.lattice.smoothing_rounds": "is fixed at 6; delete the key",
        "navigation.lattice.unknown_weight": "has moved to navigation.traversal.unknown_weight",
        "navigation.manoeuvre.after_s": "is fixed at 0.8 s; delete the key",
        "navigation.manoeuvre.stray_m": "is fixed at 0.08 m; delete the key",
        "navigation.monitor.step_s": "is fixed at 0.05 s; delete the key",
        "navigation.mppi.contact_weight": "is fixed at 3.0; delete the key",
        "navigation.mppi.front_weight": "is fixed at 0.5; delete the key",
        "navigation.mppi.lookahead_m": "is fixed at 1.2 m; delete the key",
        "navigation.mppi.seed": "is fixed at 0; delete the key",
        "navigation.mppi.step_s": "is fixed at 0.05 s; delete the key",
        "navigation.mppi.turn_end_rad": "has moved to navigation.rotate_in_place.turn_end_rad",
        "navigation.mppi.turn_start_rad": "has moved to navigation.rotate_in_place.turn_start_rad",
        "navigation.navfn": "has moved to navigation.traversal; obstacle_weight is fixed at ROS's 4.032",
        "navigation.progress.nearer_m": "is fixed at 0.20 m; delete the key",
        "navigation.progress.turned_rad": "is fixed at 0.5 rad; delete the key",
        "navigation.pure_pursuit.turn_end_rad": "is fixed at 0.2 rad; delete the key",
        "navigation.pure_pursuit.turn_start_rad": "is fixed at 0.8 rad; delete the key",
        "navigation.recovery.aggressive_m": "is fixed at 0.3 m; delete the key",
        "navigation.recovery.conservative_m": "is fixed at 0.5 m; delete the key",
        "navigation.recovery.limit_s": "is fixed at 10 s; delete the key",
        "navigation.route.blocked_period_s": "is fixed at 0.3 s; delete the key",
        "navigation.route.grace_s": "is fixed at 1.0 s; delete the key",
        "navigation.route.stray_m": "is fixed at 0.40 m; delete the key",
        "navigation.traffic.between_s": "is fixed at 0.3 s; delete the key",
        "navigation.trajectory_rollout": "uses navigation.dwa; move its keys there",
        "recording.flush_period_s": "is fixed at 0.5 s; delete the key",
        "recording.waiting_messages": "is fixed at 4096 messages; delete the key",
        "mapping.score_std_m": "is fixed at 0.1 m; delete the key",
        "mapping.search_below": "is fixed at 0.5; delete the key",
        "mapping.search_gain": "is fixed at 0.1; delete the key",
        "mapping.matching.outlier_m": "is fixed at 0.15 m; delete the key",
        "mapping.matching.open_below": "is fixed at 0.02; delete the key",
        "mapping.matching.iterations": "is fixed at 30; delete the key",
        "mapping.confidence.error_per_m": "is fixed at 0.05; delete the key",
        "mapping.confidence.error_rad_per_m": "is fixed at 0.02; delete the key",
        "mapping.confidence.error_per_rad": "is fixed at 0.05; delete the key",
        "mapping.loops.place_m": "is fixed at 2 m; delete the key",
        "mapping.loops.drift_rad_per_m": "is fixed at 0.003; delete the key",
        "mapping.loops.rival_ratio": "is fixed at 0.9; delete the key",
        "mapping.filter.cleared_beams": "is fixed at 90; delete the key",
        "mapping.filter.weight_gain": "is fixed at 0.05; delete the key",
        "mapping.filter.spread": "is fixed at 0.2; delete the key",
        "mapping.filter.climb_below": "is fixed at 0.6; delete the key",
        "mapping.filter.iterations": "is fixed at 8; delete the key",
        "localization.kld_error": "is fixed at 0.05; delete the key",
        "localization.kld_quantile": "is fixed at 2.33; delete the key",
        "localization.kld_cell_m": "is fixed at 0.25 m; delete the key",
        "localization.kld_cell_rad": "is fixed at 0.2 rad; delete the key",
        "localization.beams": "is fixed at 60; delete the key",
        "localization.random_share": "is fixed at 0.1; delete the key",
        "localization.beam_gain": "is fixed at 0.15; delete the key",
        "localization.lost_after": "is fixed at 3; delete the key",
        "localization.matching": "is fixed at the defaults of [mapping.matching]; delete the table",
        "service.heartbeat_timeout_s": "is fixed at 0.3 s; delete the key",
        "service.gamepad_timeout_s": "is fixed at 0.3 s; delete the key",
        "service.teleop_timeout_s": "is fixed at 0.3 s; delete the key",
        "teleop.v_slew_m_s2": "is fixed at 1.5 m/s^2; delete the key",
        "teleop.w_slew_rad_s2": "is fixed at 8 rad/s^2; delete the key",
        "teleop.key_first_s": "is fixed at 0.6 s; delete the key",
        "teleop.key_repeat_s": "is fixed at 0.2 s; delete the key",
    }
)

# Values of earlier versions that still work.
RENAMED: Renamed = MappingProxyType({("mapping", "method"): OLD_METHODS})


@cache
def _adapter() -> TypeAdapter[RobotConfig]:
    """Return what checks a configuration; built when one is read, which takes 0.07 s."""
    return TypeAdapter(RobotConfig)


def load_config(path: Path | None) -> RobotConfig:
    """Read the file at `path`; return the defaults for None.

    Raises
    ------
    ThumperError
        The file cannot be read, is not valid TOML, or has a wrong key, type or value. The error names it.
    """
    if path is None:
        return RobotConfig()
    config = read_checked(
        path, _adapter(), RobotConfig, "configuration", removed=REMOVED_KEYS, renamed=RENAMED
    )
    try:
        check_names(config.navigation)
    except ThumperError as error:
        raise ThumperError(f"{path}: navigation: {error}", exit_code=EXIT_USAGE) from error
    return _with_absolute_files(config, path.parent)


def _with_absolute_files(config: RobotConfig, folder: Path) -> RobotConfig:
    """Return the configuration with the files of masks and detector relative to its own folder."""
    masks, camera = config.navigation.masks, config.camera
    names = (masks.keepout, masks.speed, camera.detector)
    keepout, speed, detector = (str(folder / name) if name else "" for name in names)
    masks = replace(masks, keepout=keepout, speed=speed)
    navigation = replace(config.navigation, masks=masks)
    return replace(config, navigation=navigation, camera=replace(camera, detector=detector))


def config_to_json(config: RobotConfig) -> str:
    """Return the whole configuration as JSON, for a recording."""
    return _adapter().dump_json(config).decode()


def config_from_json(text: str) -> RobotConfig:
    """Read what `config_to_json` wrote; raises ValueError if another version wrote it."""
    data = json.loads(text)
    if not isinstance(data, dict):
        raise ValueError("the configuration is no table")
    return _adapter().validate_json(json.dumps(with_new_names(data, RENAMED)), strict=True)


def with_ports(config: RobotConfig, *, board: str, lidar: str) -> RobotConfig:
    """Return the same robot on other ports; an empty port stays as configured.

    A simulated board brings all sensors with it.

    Raises
    ------
    ThumperError
        The ports belong to two simulated robots.
    """
    board, lidar = own_simulation(board or config.board.port, lidar, config.lidar.model)
    lidar = lidar or _beside(board, "lidar", config.lidar).port
    check_same_robot(board, lidar)
    return replace(
        config,
        board=replace(config.board, port=board),
        lidar=replace(config.lidar, port=lidar),
        **{name: _beside(board, name, getattr(config, name)) for name in SENSOR_TABLES},
    )


def unused_ports(configured: RobotConfig, used: RobotConfig) -> list[str]:
    """Return the enabled sensors' own ports, such as `[gps] port /dev/ttyUSB2`, that `with_ports` replaced.

    A port that is still the default is no choice, and not named.
    """
    default, names = RobotConfig(), []
    for table in ("lidar", *SENSOR_TABLES):
        mine, new, usual = (getattr(config, table) for config in (configured, used, default))
        if getattr(mine, "enabled", True) and mine.port not in {new.port, usual.port}:
            names.append(f"[{table}] port {mine.port}")
    return names


def device_ports(config: RobotConfig) -> dict[str, str]:
    """Return the ports of board, lidar and enabled sensors, by the name of their table."""
    tables = [name for name in SENSOR_TABLES if getattr(config, name).enabled]
    if config.imu.uses_board:
        tables.remove("imu")
    return {table: getattr(config, table).port for table in ("board", "lidar", *tables)}


def shared_port(config: RobotConfig) -> str:
    """Return which two devices have the same port, in one line; empty if each has its own."""
    owners: dict[str, str] = {}
    for table, port in device_ports(config).items():
        owner = owners.setdefault(os.path.realpath(port), table)
        if owner != table:
            return f"[{table}] port {port} is also that of [{owner}]; give each device its own"
    return ""


def _beside(board: str, name: str, options: Any) -> Any:
    """Return a sensor's options with the port of the same simulated robot; a real robot's keep their own."""
    url = urlsplit(board)
    return replace(options, port=f"sim://{url.netloc}/{name}") if url.scheme == "sim" else options


def check_same_robot(board: str, lidar: str) -> None:
    """Raise ThumperError if the ports belong to two simulated robots."""
    urls = (urlsplit(board), urlsplit(lidar))
    board_robot, lidar_robot = (url.netloc if url.scheme == "sim" else "" for url in urls)
    if board_robot and lidar_robot and board_robot != lidar_robot:
        raise ThumperError(
            f"sim://{board_robot} and sim://{lidar_robot} are two simulated robots; "
            "use the same name for board and lidar",
            exit_code=EXIT_USAGE,
        )
