"""Saved SLAM state: hit and miss counts and the robot's pose, so that mapping can resume later.

The file is one line of JSON, then the counts, compressed with zlib. The JSON holds the format version, the
shape, the pose and a SHA-256 of everything. A truncated or changed file is refused as a whole.
"""

import hashlib
import json
import math
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import read_bytes, unreadable, write_whole
from thumper.common.geometry import Pose2
from thumper.common.resumable import bands_of
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import MAX_CELLS
from thumper.slam.mapper import Mapper

VERSION = 2
MAX_MB = 400.0  # counts that do not compress
MAX_POSITION_M = 1e8


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedSlamState:
    """Everything needed to resume mapping."""

    counts: HitCounts
    map_from_base: Pose2 | None  # the robot's pose when saved; None if it was lost

    @classmethod
    def from_mapper(cls, mapper: Mapper, map_from_base: Pose2 | None) -> "SavedSlamState":
        """Return the mapper's state, with the pose only if it is not lost."""
        return cls(counts=mapper.counts(), map_from_base=None if mapper.quality().lost else map_from_base)


def save_session(session: SavedSlamState, path: Path) -> Path:
    """Write the session file and return its path. The file appears whole or not at all.

    Raises
    ------
    ThumperError
        The file cannot be written.
    """
    counts, pose = session.counts, session.map_from_base
    compressor = zlib.compressobj(6)
    parts = (each[band] for each in (counts.hits, counts.misses) for band in bands_of(each.shape))
    payload = b"".join(compressor.compress(part.astype("<u2").data) for part in parts)
    payload += compressor.flush()
    header: dict[str, Any] = {
        "thumper_session": VERSION,
        "shape": counts.hits.shape,
        "first_cell": counts.first_cell,
        "resolution_m": counts.resolution_m,
        "pose": [pose.x_m, pose.y_m, pose.theta_rad] if pose else None,
    }
    header["sha256"] = _checksum(header, payload)
    with write_whole(path) as stream:
        stream.write(json.dumps(header).encode() + b"\n" + payload)
    return path


def load_session(path: Path, resolution_m: float) -> SavedSlamState:
    """Read a file written by `save_session`, for a mapper with cells of this size.

    Raises
    ------
    ThumperError
        The file cannot be read, is damaged, is not a session, or has another version or resolution.
    """
    try:
        first, _, payload = read_bytes(path, MAX_MB).partition(b"\n")
    except OSError as error:
        raise unreadable(path, error) from error
    try:
        session = _parse(path, json.loads(first), payload)
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError, zlib.error) as error:
        raise ThumperError(
            f"{path}: not a mapping session; pass a .session file (open a map's .yaml with --map)",
            exit_code=EXIT_USAGE,
        ) from error
    size_m = session.counts.resolution_m
    if size_m != resolution_m:
        raise ThumperError(
            f"{path}: the session has cells of {size_m} m; set mapping.resolution_m = {size_m} to resume it",
            exit_code=EXIT_USAGE,
        )
    return session


def _parse(path: Path, header: dict[str, Any], payload: bytes) -> SavedSlamState:
    version = header["thumper_session"]
    if version != VERSION:
        raise ThumperError(
            f"{path}: session version {version}, but this program reads version {VERSION}; use the program "
            "that wrote the file",
            exit_code=EXIT_USAGE,
        )
    if _checksum(header, payload) != header["sha256"]:
        raise ThumperError(f"{path}: wrong checksum, the file is damaged; use a backup", exit_code=EXIT_USAGE)
    rows, cols = (int(size) for size in header["shape"])
    row, col = (int(index) for index in header["first_cell"])
    size_m = float(header["resolution_m"])
    pose = None
    if header["pose"] is not None:
        x_m, y_m, theta_rad = (float(value) for value in header["pose"])
        pose = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
        if not math.hypot(x_m, y_m) + abs(theta_rad) < MAX_POSITION_M:
            raise ValueError(f"a pose at {x_m}, {y_m}, {theta_rad}")
    if not (min(rows, cols) >= 0 and rows * cols <= MAX_CELLS and max(abs(row), abs(col)) <= MAX_CELLS):
        raise ValueError(f"{rows} x {cols} cells from {row}, {col}")
    size = 4 * rows * cols  # two counts of two bytes; a hostile file may unpack to more
    unpacked = zlib.decompressobj().decompress(payload, size + 1)
    hits, misses = np.frombuffer(unpacked, dtype="<u2").reshape(2, rows, cols)
    counts = HitCounts(hits=hits, misses=misses, first_cell=(row, col), resolution_m=size_m)
    return SavedSlamState(counts=counts, map_from_base=pose)


def _checksum(header: dict[str, Any], payload: bytes) -> str:
    """Return the SHA-256 of the payload and of every header field but the checksum itself."""
    fields = {key: value for key, value in header.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(fields, sort_keys=True).encode() + payload).hexdigest()
