"""A map in the making on disk, so that mapping can go on another day: counts, not just black and white.

The file is one line of JSON and then the counts, compressed with zlib. The line names the format's version,
the shape, the pose, and the SHA-256 of it all: a file that was cut off or changed is refused, not half read.
"""

import hashlib
import json
import os
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from thumper.errors import ThumperError
from thumper.geometry import Pose2
from thumper.mapping.cells import Cells
from thumper.mapping.grid_mapper import GridMapper, GridMapperOptions

VERSION = 2
LARGEST_CELLS = 400_000_000  # 1 km by 1 km at 5 cm


def save_session(mapper: GridMapper, path: Path) -> None:
    """Write the map and the robot's pose; the file appears whole or not at all.

    Raises
    ------
    ThumperError
        The file cannot be written.
    """
    cells, pose = mapper.cells, mapper.map_from_base
    payload = zlib.compress(np.stack((cells.hits, cells.misses)).astype("<u2").tobytes(), 6)
    header: dict[str, Any] = {
        "thumper_session": VERSION,
        "shape": cells.hits.shape,
        "first_cell": cells.first_cell,
        "resolution_m": cells.resolution_m,
        "pose": [pose.x_m, pose.y_m, pose.theta_rad],
    }
    header["sha256"] = _checksum(header, payload)
    partial = path.with_name(path.name + ".part")
    try:
        with partial.open("wb") as stream:
            stream.write(json.dumps(header).encode() + b"\n" + payload)
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(path)
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot be written ({error.strerror}); check the folder", exit_code=2
        ) from error


def load_session(
    path: Path,
    options: GridMapperOptions | None = None,
    *,
    base_from_laser: Pose2 | None = None,
    map_from_base: Pose2 | None = None,
) -> GridMapper:
    """Give a mapper that goes on with a saved map, the robot standing where it stood or at `map_from_base`.

    Raises
    ------
    ThumperError
        The file cannot be read, is damaged, or is of another version or resolution.
    """
    options = options or GridMapperOptions()
    try:
        first, _, payload = path.read_bytes().partition(b"\n")
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot be read ({error.strerror}); check the path", exit_code=2
        ) from error
    try:
        header = json.loads(first)
        version = header["thumper_session"]
        if version != VERSION:
            raise ThumperError(
                f"{path}: session version {version}; this program reads version {VERSION}", exit_code=2
            )
        if _checksum(header, payload) != header["sha256"]:
            raise ThumperError(
                f"{path}: the checksum is wrong, the file is damaged; use a backup", exit_code=2
            )
        rows, cols = (int(size) for size in header["shape"])
        row, col = (int(index) for index in header["first_cell"])
        resolution_m = float(header["resolution_m"])
        x_m, y_m, theta_rad = (float(value) for value in header["pose"])
        if not 0 <= rows * cols <= LARGEST_CELLS:
            raise ValueError(f"{rows} x {cols} cells")
        counts = np.frombuffer(zlib.decompress(payload), dtype="<u2").reshape(2, rows, cols)
    except (ValueError, KeyError, TypeError, zlib.error) as error:
        raise ThumperError(f"{path}: not a mapping session ({error}); save it again", exit_code=2) from error
    if resolution_m != options.resolution_m:
        raise ThumperError(
            f"{path}: its cells are {resolution_m} m; set mapping.resolution_m = {resolution_m} to go on",
            exit_code=2,
        )
    cells = Cells(options.resolution_m, options.reach_m, options.occupied_fraction)
    cells.fill(counts[0], counts[1], (row, col))
    pose = map_from_base or Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
    mapper = GridMapper(options, base_from_laser=base_from_laser, map_from_base=pose)
    mapper.restart(cells, pose)
    return mapper


def _checksum(header: dict[str, Any], payload: bytes) -> str:
    """Of the counts and of all that the header says but itself."""
    said = {key: value for key, value in header.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode() + payload).hexdigest()
