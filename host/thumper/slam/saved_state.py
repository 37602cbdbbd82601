"""A map in the making on disk, so that mapping can go on another day: counts, not just black and white.

The file is one line of JSON and then the counts, compressed with zlib. The line names the format's version,
the shape, the pose, and the SHA-256 of it all: a file that was cut off or changed is refused, not half read.
"""

import hashlib
import json
import os
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2
from thumper.maps.hit_counts import HitCounts
from thumper.slam.mapper import Mapper

VERSION = 2
LARGEST_CELLS = 400_000_000  # 1 km by 1 km at 5 cm


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedSlamState:
    """All that it takes to go on with a map."""

    counts: HitCounts
    map_from_base: Pose2 | None  # where the robot was when it was saved; None when it did not know

    @classmethod
    def of(cls, mapper: Mapper, map_from_base: Pose2) -> "SavedSlamState":
        """What a mapper knows; the pose only where it may be trusted."""
        return cls(counts=mapper.counts(), map_from_base=None if mapper.quality().lost else map_from_base)


def save_session(session: SavedSlamState, path: Path) -> Path:
    """Write it; the file appears whole or not at all. Returns its path.

    Raises
    ------
    ThumperError
        The file cannot be written.
    """
    counts, pose = session.counts, session.map_from_base
    packer = zlib.compressobj(6)
    payload = b"".join(packer.compress(each.astype("<u2").data) for each in (counts.hits, counts.misses))
    payload += packer.flush()
    header: dict[str, Any] = {
        "thumper_session": VERSION,
        "shape": counts.hits.shape,
        "first_cell": counts.first_cell,
        "resolution_m": counts.resolution_m,
        "pose": [pose.x_m, pose.y_m, pose.theta_rad] if pose else None,
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
            f"{path}: cannot be written ({error.strerror}); check the folder", exit_code=EXIT_USAGE
        ) from error
    return path


def load_session(path: Path, resolution_m: float) -> SavedSlamState:
    """Read what `save_session` wrote, for a mapper whose cells are of this size.

    Raises
    ------
    ThumperError
        The file cannot be read, is damaged or no session, or is of another version or resolution.
    """
    try:
        first, _, payload = path.read_bytes().partition(b"\n")
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot be read ({error.strerror}); check the path", exit_code=EXIT_USAGE
        ) from error
    try:
        header = json.loads(first)
        version = header["thumper_session"]
        if version != VERSION:
            raise ThumperError(
                f"{path}: session version {version}; this program reads version {VERSION}: use the one that "
                "wrote it",
                exit_code=EXIT_USAGE,
            )
        if _checksum(header, payload) != header["sha256"]:
            raise ThumperError(
                f"{path}: the checksum is wrong, the file is damaged; use a backup", exit_code=EXIT_USAGE
            )
        rows, cols = (int(size) for size in header["shape"])
        row, col = (int(index) for index in header["first_cell"])
        size_m = float(header["resolution_m"])
        pose = None
        if header["pose"] is not None:
            x_m, y_m, theta_rad = (float(value) for value in header["pose"])
            pose = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
        if not 0 <= rows * cols <= LARGEST_CELLS:
            raise ValueError(f"{rows} x {cols} cells")
        hits, misses = np.frombuffer(zlib.decompress(payload), dtype="<u2").reshape(2, rows, cols)
    except (ValueError, KeyError, TypeError, OverflowError, zlib.error) as error:
        raise ThumperError(
            f"{path}: not a mapping session; give a .session file (a map's .yaml goes with --map)",
            exit_code=EXIT_USAGE,
        ) from error
    if size_m != resolution_m:
        raise ThumperError(
            f"{path}: its cells are {size_m} m; set mapping.resolution_m = {size_m} to go on",
            exit_code=EXIT_USAGE,
        )
    counts = HitCounts(hits=hits, misses=misses, first_cell=(row, col), resolution_m=size_m)
    return SavedSlamState(counts=counts, map_from_base=pose)


def _checksum(header: dict[str, Any], payload: bytes) -> str:
    """Of the counts and of all that the header says but itself."""
    said = {key: value for key, value in header.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode() + payload).hexdigest()
