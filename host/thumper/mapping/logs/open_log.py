"""Opening a robot log without being told its format."""

import gzip
import zlib
from pathlib import Path

from thumper.errors import ThumperError
from thumper.mapping.logs.carmen import is_carmen, read_carmen
from thumper.mapping.logs.mines import is_mines, read_mines
from thumper.mapping.logs.record import RobotLog

GZIP_MAGIC = b"\x1f\x8b"


def open_log(path: Path) -> RobotLog:
    """Read a CARMEN or MINES log, plain or gzip-compressed: the content decides, not the name.

    Raises
    ------
    ThumperError
        The file cannot be read, is cut off, or is in none of these formats.
    """
    try:
        data = path.read_bytes()
        if data.startswith(GZIP_MAGIC):
            data = gzip.decompress(data)
        text = data.decode("ascii")
    except FileNotFoundError as error:
        raise ThumperError(f"{path}: no such file; check the path") from error
    except OSError as error:
        raise ThumperError(f"{path}: cannot be read ({error}); check the file and its permissions") from error
    except (EOFError, zlib.error) as error:
        raise ThumperError(f"{path}: the compressed file is cut off ({error}); copy it again") from error
    except UnicodeDecodeError as error:
        raise ThumperError(
            f"{path}: not a text log; give a CARMEN (.log, .clf) or MINES (.dat) log"
        ) from error
    lines = [line for line in text.splitlines() if line and not line.isspace()]
    if is_carmen(lines):
        return read_carmen(str(path), lines)
    if is_mines(lines):
        return read_mines(str(path), lines)
    raise ThumperError(f"{path}: unknown log format; give a CARMEN (.log, .clf) or MINES (.dat) log")
