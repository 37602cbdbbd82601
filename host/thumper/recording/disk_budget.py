"""The folder that a robot's recordings lie in: their names, and how much they may take together."""

import re
import time
from pathlib import Path

from thumper.recording.mcap_file import PART

MAGIC = b"\x89MCAP0\r\n"
OWN_MARK = b"thumper "  # the library that the file's header names
HEAD_BYTES = 64


def safe_name(robot: str) -> str:
    """The robot's name as a part of a file's."""
    return re.sub(r"[^A-Za-z0-9-]+", "-", robot).strip("-") or "robot"


def new_name(folder: Path, robot: str, part: int) -> Path:
    """Name for a file that begins now; `part` counts the files of one run from 0."""
    stamp = time.strftime("%Y%m%d-%H%M%S")
    base = f"{safe_name(robot)}_{stamp}_{part:03d}"
    for again in range(1000):
        path = folder / (f"{base}.mcap" if not again else f"{base}-{again}.mcap")
        if not path.exists() and not path.with_name(path.name + PART).exists():
            return path
    raise OSError(f"{folder}: no free name for a recording")


def own_recordings(folder: Path, robot: str) -> list[Path]:
    """The finished recordings of this robot that this program made, oldest first."""
    pattern = re.compile(rf"{re.escape(safe_name(robot))}_\d{{8}}-\d{{6}}_\d{{3}}(-\d+)?\.mcap")
    return sorted(path for path in folder.iterdir() if pattern.fullmatch(path.name) and _is_own(path))


def make_room(folder: Path, robot: str, *, budget_bytes: float, reserve_bytes: float) -> list[Path]:
    """Delete the oldest recordings until the rest and `reserve_bytes` for the next keep to the budget."""
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


def _is_own(path: Path) -> bool:
    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as stream:
        head = stream.read(HEAD_BYTES)
    return head.startswith(MAGIC) and OWN_MARK in head
