"""Names and total size of a robot's recordings in their folder, and room on its disk."""

import errno
import re
import shutil
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
    # Three digits, from part 1000 on four or more.
    pattern = re.compile(rf"{re.escape(safe_name(robot))}_(\d{{8}}-\d{{6}})_(\d{{3,}})(?:-(\d+))?\.mcap")
    found = [
        ((match[1], int(match[2]), int(match[3] or 0)), path)
        for path in folder.iterdir()
        if (match := pattern.fullmatch(path.name)) and _is_thumper_file(path)
    ]
    return [path for _, path in sorted(found)]


def check_room(folder: Path, spare_bytes: float) -> None:
    """Raise OSError (ENOSPC) if less than `spare_bytes` are free on the folder's disk."""
    if shutil.disk_usage(folder).free < spare_bytes:
        raise OSError(
            errno.ENOSPC, f"less than {spare_bytes / 1e6:.0f} MB are free on the disk; delete files"
        )


def is_full(error: OSError) -> bool:
    """Return whether the disk, the quota or the file has no room: this may pass."""
    return error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


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
