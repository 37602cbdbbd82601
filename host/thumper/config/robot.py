"""Read the robot's TOML and check every key, type and range. Nothing unknown is ignored."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated
from urllib.parse import urlsplit

from annotated_types import Gt, Le
from pydantic import StringConstraints, TypeAdapter

from thumper.board.options import BoardOptions
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.kinematics import DriveGeometry
from thumper.common.strict_toml import read_checked
from thumper.config.bus import ROBOT_NAME, BusOptions
from thumper.config.dashboard import DashboardOptions
from thumper.config.manual_drive import ManualDriveOptions
from thumper.config.recording import RecordingOptions
from thumper.config.teleop import TeleopOptions
from thumper.lidar.options import LidarOptions
from thumper.navigation.footprint import Footprint
from thumper.navigation.options import NavigationOptions
from thumper.navigation.registry import check_names
from thumper.odometry.imu import ImuOptions
from thumper.slam.factory import MappingOptions
from thumper.slam.localization.options import AmclOptions


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveOptions(DriveGeometry):
    """Geometry of the drive, and the fastest wheel speed to ask for."""

    max_wheel_rad_s: Annotated[float, Gt(0), Le(17)] = 13.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotConfig:
    """Everything that `thumper` needs to know of one robot; the defaults are the Wild Thumper's."""

    # Letters, digits, - and _: a part of the bus's keys and of recordings' names.
    name: Annotated[str, StringConstraints(pattern=ROBOT_NAME)] = "thumper"
    board: BoardOptions = field(default_factory=BoardOptions)
    lidar: LidarOptions = field(default_factory=LidarOptions)
    drive: DriveOptions = field(default_factory=DriveOptions)
    imu: ImuOptions = field(default_factory=ImuOptions)
    mapping: MappingOptions = field(default_factory=MappingOptions)
    localization: AmclOptions = field(default_factory=AmclOptions)
    footprint: Footprint = field(default_factory=Footprint)
    navigation: NavigationOptions = field(default_factory=NavigationOptions)
    service: ManualDriveOptions = field(default_factory=ManualDriveOptions)
    bus: BusOptions = field(default_factory=BusOptions)
    dashboard: DashboardOptions = field(default_factory=DashboardOptions)
    recording: RecordingOptions = field(default_factory=RecordingOptions)
    teleop: TeleopOptions = field(default_factory=TeleopOptions)


# Keys and tables of earlier versions: the full key, and how "KEY was removed: it ..." goes on. Append here
# what you remove, so that an old file is refused with the reason and the fix.
REMOVED_KEYS: Mapping[str, str] = MappingProxyType(
    {
        "recording.flush_period_s": "is fixed at 0.5 s; delete the key",
        "recording.waiting_messages": "is fixed at 4096 messages; delete the key",
    }
)

_ADAPTER = TypeAdapter(RobotConfig)


def load_config(path: Path | None) -> RobotConfig:
    """Read `path`, or give the defaults for None.

    Raises
    ------
    ThumperError
        The file cannot be read, is no TOML, or holds a key, type or value that is wrong: named with the file.
    """
    if path is None:
        return RobotConfig()
    config = read_checked(path, _ADAPTER, RobotConfig, "configuration", removed=REMOVED_KEYS)
    try:
        check_names(config.navigation)
    except ThumperError as error:
        raise ThumperError(f"{path}: navigation: {error}", exit_code=EXIT_USAGE) from error
    return _with_files_beside(config, path.parent)


def _with_files_beside(config: RobotConfig, folder: Path) -> RobotConfig:
    """Files that the configuration names are looked for from its own folder."""
    masks = config.navigation.masks
    keepout, speed = (str(folder / name) if name else "" for name in (masks.keepout, masks.speed))
    masks = replace(masks, keepout=keepout, speed=speed)
    return replace(config, navigation=replace(config.navigation, masks=masks))


def config_to_json(config: RobotConfig) -> str:
    """The whole configuration, for a recording."""
    return _ADAPTER.dump_json(config).decode()


def config_from_json(text: str) -> RobotConfig:
    """What `config_to_json` wrote; raises ValueError when it is of another version of the program."""
    return _ADAPTER.validate_json(text, strict=True)


def with_ports(config: RobotConfig, *, board: str, lidar: str) -> RobotConfig:
    """The same robot on other ports; an empty one stays as configured.

    Raises
    ------
    ThumperError
        They are ports of two simulated robots.
    """
    board, lidar = board or config.board.port, lidar or config.lidar.port
    check_same_robot(board, lidar)
    return replace(config, board=replace(config.board, port=board), lidar=replace(config.lidar, port=lidar))


def check_same_robot(board: str, lidar: str) -> None:
    """Refuse the ports of two simulated robots; raises ThumperError."""
    urls = (urlsplit(board), urlsplit(lidar))
    one, other = (url.netloc if url.scheme == "sim" else "" for url in urls)
    if one and other and one != other:
        raise ThumperError(
            f"sim://{one} and sim://{other} are two simulated robots: give board and lidar the same name",
            exit_code=EXIT_USAGE,
        )
