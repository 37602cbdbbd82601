"""What a recording says of its run: enough to do the same computation again, and to know who did it."""

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

METADATA_NAME = "thumper"
PACKAGES = ("numpy", "numba", "rosbags", "mcap")  # which decide what a replay computes and reads


@dataclass(frozen=True, slots=True, kw_only=True)
class RunMetadata:
    """One run of the program on one robot."""

    config: RobotConfig
    epoch_ns: int  # what zero of the host's clock is in the stamps
    map_from_base: Pose2 = field(default_factory=Pose2)  # where the robot stood at the start
    simulated: bool = False
    firmware: str = ""
    from_start: bool = True  # whether it begins before the first scan was mapped

    def as_metadata(self) -> dict[str, str]:
        """Strings by name, as MCAP keeps them. Secrets of bus and page are left out."""
        pose = self.map_from_base
        config = replace(self.config, bus=BusOptions(), dashboard=DashboardOptions())
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


def session_of(metadata: dict[str, str], name: str) -> RunMetadata:
    """Read what `as_metadata` wrote; `name` is the file's, for the message.

    Raises
    ------
    ThumperError
        It is of another version of the program, or no recording of this robot at all.
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
        made_by = metadata.get("version", "another program")
        raise ThumperError(
            f"{name}: its configuration cannot be read ({error}): it was recorded by {made_by}, this is "
            f"{__version__}; give the robot's TOML with --config",
            exit_code=EXIT_USAGE,
        ) from error


def firmware_words(identity: Identity) -> str:
    """Version, board and schema hash of the firmware that answered."""
    number = f"{identity.version_major}.{identity.version_minor}.{identity.version_patch}"
    return f"{number} {identity.board.name} schema {identity.schema_hash:08x}"


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
