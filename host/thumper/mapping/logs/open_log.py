"""Opening a robot log without being told its format."""

import gzip
import zlib
from collections.abc import Iterable
from pathlib import Path

from thumper.errors import ThumperError
from thumper.mapping.logs.carmen import is_carmen, read_carmen
from thumper.mapping.logs.mines import is_mines, read_mines
from thumper.mapping.logs.record import RobotLog

GZIP_MAGIC = b"\x1f\x8b"
MCAP_MAGIC = b"\x89MCAP0\r\n"


def open_log(path: Path, fov_rad: float | None = None) -> RobotLog:
    """Read a CARMEN or MINES log, plain or gzip-compressed, or an MCAP file: the content decides.

    `fov_rad` is the laser's field of view where a CARMEN log does not tell it.

    Raises
    ------
    ThumperError
        The file cannot be read, is cut off, or is in none of these formats.
    """
    try:
        with path.open("rb") as plain:
            start = plain.read(len(MCAP_MAGIC))
        if start == MCAP_MAGIC:
            from thumper.mapping.logs.mcap import read_mcap  # loads the ROS 2 types

            return read_mcap(path)
        packed = start.startswith(GZIP_MAGIC)
        # Line by line: a text held whole, and again as lines, would be the largest thing in memory.
        opener = gzip.open if packed else open
        with opener(path, "rt", encoding="ascii") as stream:
            kind = _kind(stream)
        with opener(path, "rt", encoding="ascii") as stream:
            if kind == "CARMEN":
                return read_carmen(str(path), stream, fov_rad)
            if kind == "MINES":
                return read_mines(str(path), (line for line in stream if not line.isspace()))
    except FileNotFoundError as error:
        raise ThumperError(f"{path}: no such file; check the path", exit_code=2) from error
    except (EOFError, zlib.error) as error:
        raise ThumperError(
            f"{path}: the compressed file is cut off ({error}); copy it again", exit_code=2
        ) from error
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot be read ({error}); check the file and its permissions", exit_code=2
        ) from error
    except UnicodeDecodeError as error:
        raise ThumperError(
            f"{path}: not a text log; give a CARMEN (.log, .clf), MINES (.dat) or MCAP log", exit_code=2
        ) from error
    raise ThumperError(
        f"{path}: unknown log format; give a CARMEN (.log, .clf), MINES (.dat) or MCAP log", exit_code=2
    )


def _kind(lines: Iterable[str]) -> str:
    """The format by the first line that tells it; CARMEN's may come after thousands of other lines."""
    for number, line in enumerate(line for line in lines if not line.isspace()):
        if is_carmen((line,)):
            return "CARMEN"
        if number == 0 and is_mines((line,)):
            return "MINES"
    return ""
