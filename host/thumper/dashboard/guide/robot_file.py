"""The robot's configuration that the first run writes. It never replaces a file."""

import json
import re
from dataclasses import dataclass
from itertools import chain, count
from pathlib import Path

from thumper.common.errors import ThumperError

ROBOT_FILE = Path("robot.toml")
FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,39}\.toml")
# Worlds of a simulated robot by their label. From the start, 1.2 m ahead and behind are free for tuning.
WORLDS = {
    "Laboratory: one room of 4.8 x 3.8 m": "lab",
    "Hall: empty, 14 x 6 m": "hall",
    "House 4: furnished rooms": "house-4&x_m=5.3&y_m=3.3&yaw_deg=90",
}
LABORATORY = next(iter(WORLDS))
FIRST_SPEED_M_S = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Ports:
    """Ports of the robot, and the model of its lidar."""

    board: str
    lidar: str
    lidar_model: str = "urg04lx"

    @property
    def simulated(self) -> bool:
        """Whether the robot is a simulated one."""
        return self.board.startswith("sim://")


def simulated_ports(world: str = LABORATORY) -> Ports:
    """Return the ports of a simulated robot in one of `WORLDS`."""
    return Ports(board=f"sim://setup/board?world={WORLDS[world]}", lidar="sim://setup/lidar")


def free_name(folder: Path) -> str:
    """Return `robot.toml`, or the first of `robot_2.toml`, `robot_3.toml`, ... that does not exist."""
    names = (f"{ROBOT_FILE.stem}_{number}.toml" for number in count(2))
    return next(name for name in chain((ROBOT_FILE.name,), names) if not (folder / name).exists())


def write_robot_file(folder: Path, name: str, ports: Ports) -> Path:
    """Write the configuration as a new file and return its path.

    Raises
    ------
    ThumperError
        The name is no plain file name, the file exists, a port is missing, or the folder is not writable.
    """
    if not FILE_NAME.fullmatch(name):
        raise ThumperError(f"{name or 'the file'}: use letters, digits, - and _, and end with .toml")
    if not (ports.board and ports.lidar) or ports.board == ports.lidar:
        raise ThumperError("choose the board's port and the lidar's; they differ")
    path = folder / name
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(_text(ports))
    except FileExistsError:
        raise ThumperError(
            f"{name} exists and stays as it is; choose another name, or start `thumper setup --config {name}`"
        ) from None
    except OSError as error:
        raise ThumperError(f"{path}: {error.strerror}") from error
    return path


def _text(ports: Ports) -> str:
    return f"""# Written by `thumper setup`.
[board]
port = {json.dumps(ports.board)}

[lidar]
model = {json.dumps(ports.lidar_model)}
port = {json.dumps(ports.lidar)}

# Slow at first. Delete these lines for full speed.
[navigation.limits]
v_max_m_s = {FIRST_SPEED_M_S}
"""
