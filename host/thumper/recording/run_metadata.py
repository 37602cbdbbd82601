"""Metadata of a recorded run: enough to repeat its computation, and to identify the robot."""

import json
import platform
from dataclasses import dataclass, field, replace
from importlib.metadata import PackageNotFoundError, version

from thumper.board.messages import Identity
from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2
from thumper.common.version import __version__
from thumper.config.bus import BusOptions
from thumper.config.dashboard import DashboardOptions
from thumper.config.robot import RobotConfig, config_from_json, config_to_json
from thumper.config.ros import RosOptions

METADATA_NAME = "thumper"
PACKAGES = ("numpy", "numba", "rosbags", "mcap")  # packages that determine the result of a replay


@dataclass(frozen=True, slots=True, kw_only=True)
class RunMetadata:
    """Metadata of one run on one robot."""

    config: RobotConfig
    epoch_ns: int  # stamp at zero of the host's clock
    map_from_base: Pose2 = field(default_factory=Pose2)  # start pose
    simulated: bool = False
    firmware: str = ""
    from_start: bool = True  # whether the recording starts before the first scan was mapped

    def as_metadata(self) -> dict[str, str]:
        """Return the metadata as strings by name, for MCAP, without the secrets of bus, ROS and page."""
        pose = self.map_from_base
        config = replace(self.config, bus=BusOptions(), ros=RosOptions(), dashboard=DashboardOptions())
        return {
            "version": __version__,
            "robot": self.config.name,
            "epoch_ns": str(self.epoch_ns),
            "start": json.dumps([pose.x_m, pose.y_m, pose.theta_rad]),
            "simulated": json.dumps(self.simulated),
            "from_start": json.dumps(self.from_start),
            "firmware": self.firmware,
            "python": platform.python_version(),
            "machine": f"{platform.system()} {platform.machine()}",
            "packages": json.dumps({name: _version(name) for name in PACKAGES}),
            "config": config_to_json(config),
        }


def run_metadata_of(metadata: dict[str, str], name: str) -> RunMetadata:
    """Read what `as_metadata` wrote; errors name the file as `name`.

    Raises
    ------
    ThumperError
        Another version, or another program, made the recording.
    """
    try:
        x_m, y_m, theta_rad = (float(value) for value in json.loads(metadata["start"]))
        return RunMetadata(
            config=config_from_json(metadata["config"]),
            epoch_ns=int(metadata["epoch_ns"]),
            map_from_base=Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad),
            simulated=bool(json.loads(metadata["simulated"])),
            firmware=metadata["firmware"],
            from_start=bool(json.loads(metadata["from_start"])),
        )
    except (KeyError, ValueError, TypeError) as error:
        version_of_file = metadata.get("version", "another program")
        raise ThumperError(
            f"{name}: its configuration cannot be read ({error}): {version_of_file} recorded it, this is "
            f"{__version__}; pass the robot's TOML with --config",
            exit_code=EXIT_USAGE,
        ) from error


def firmware_text(identity: Identity) -> str:
    """Return version, board and schema hash of the firmware as text."""
    number = f"{identity.version_major}.{identity.version_minor}.{identity.version_patch}"
    return f"{number} {identity.board.name} schema {identity.schema_hash:08x}"


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
