"""Names and total size of a robot's recordings in their folder."""

import re
import time
from pathlib import Path

from thumper.recording.mcap_file import PART

MAGIC = b"\x89MCAP0\r\n"
LIBRARY_MARK = b"thumper "  # start of the library name in the file's header
HEADER_BYTES = 64


def safe_name(robot: str) -> str:
    """Return the robot's name as part of a file name."""
    return re.sub(r"[^A-Za-z0-9-]+", "-", robot).strip("-") or "robot"


def new_name(folder: Path, robot: str, part: int) -> Path:
    """Return a name for a file that starts now; `part` counts the files of one run from 0."""
    stamp = time.strftime("%Y%m%d-%H%M%S")
    base = f"{safe_name(robot)}_{stamp}_{part:03d}"
    for number in range(1000):
        path = folder / (f"{base}.mcap" if not number else f"{base}-{number}.mcap")
        if not path.exists() and not path.with_name(path.name + PART).exists():
            return path
    raise OSError(f"{folder}: no free name for a recording")


def own_recordings(folder: Path, robot: str) -> list[Path]:
    """Return the finished recordings of this robot that Thumper made, oldest first."""
    pattern = re.compile(rf"{re.escape(safe_name(robot))}_\d{{8}}-\d{{6}}_\d{{3}}(-\d+)?\.mcap")
    return sorted(
        path for path in folder.iterdir() if pattern.fullmatch(path.name) and _is_thumper_file(path)
    )


def make_room(folder: Path, robot: str, *, budget_bytes: float, reserve_bytes: float) -> list[Path]:
    """Delete the oldest recordings until the rest and `reserve_bytes` fit in the budget; return them."""
    recordings = own_recordings(folder, robot)
    sizes = {path: path.stat().st_size for path in recordings}
    total, deleted = reserve_bytes + sum(sizes.values()), []
    for path in recordings:
        if total <= budget_bytes:
            break
        path.unlink()
        total -= sizes[path]
        deleted.append(path)
    return deleted


def _is_thumper_file(path: Path) -> bool:
    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as stream:
        header = stream.read(HEADER_BYTES)
    return header.startswith(MAGIC) and LIBRARY_MARK in header
