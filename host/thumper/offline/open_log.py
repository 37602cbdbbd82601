"""Opening a robot log without being told its format."""

import gzip
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TextIO

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.offline.carmen import is_carmen, read_carmen
from thumper.offline.mines import is_mines, read_mines
from thumper.offline.robot_log import RobotLog, refuse_fov

GZIP_MAGIC = b"\x1f\x8b"
FORMATS = "give a CARMEN (.log, .clf), MINES (.dat) or MCAP log"
CUT = "the compressed file is cut off or damaged, and used up to there ({})"
MCAP_MAGIC = b"\x89MCAP0\r\n"


def open_log(path: Path, fov_rad: float | None = None) -> RobotLog:
    """Read a CARMEN, MINES or MCAP log, plain or gzip-compressed: the content decides.

    `fov_rad` is the laser's field of view where a CARMEN log does not tell it. A compressed file that is cut
    off is read up to there, with a note.

    Raises
    ------
    ThumperError
        The file cannot be read, is in none of these formats, or tells its field of view itself.
    """
    cut: list[str] = []
    try:
        with path.open("rb") as plain:
            start = plain.read(len(MCAP_MAGIC))
        if start == MCAP_MAGIC:
            from thumper.offline.mcap_log import read_mcap  # loads the ROS 2 types

            refuse_fov(str(path), fov_rad, "an MCAP log")
            return read_mcap(path)
        if start.startswith(GZIP_MAGIC) and _starts_as_mcap(path):
            refuse_fov(str(path), fov_rad, "an MCAP log")
            return _unpacked_mcap(path)
        with _text(path, start) as stream:
            kind = _kind(_until_cut(stream, cut), path)
        with _text(path, start) as stream:
            lines = _until_cut(stream, cut)
            if kind == "CARMEN":
                log = read_carmen(str(path), lines, fov_rad)
            elif kind == "MINES":
                refuse_fov(str(path), fov_rad, "a MINES log")
                log = read_mines(str(path), (line for line in lines if not line.isspace()))
            elif cut:
                raise ThumperError(f"{path}: {cut[0]}; copy it again", exit_code=EXIT_USAGE)
            else:
                raise ThumperError(f"{path}: unknown log format; {FORMATS}", exit_code=EXIT_USAGE)
    except FileNotFoundError as error:
        raise ThumperError(f"{path}: no such file; check the path", exit_code=EXIT_USAGE) from error
    except IsADirectoryError as error:
        raise ThumperError(f"{path}: is a folder; give one log in it", exit_code=EXIT_USAGE) from error
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot be read ({error}); check the file and its permissions", exit_code=EXIT_USAGE
        ) from error
    return replace(log, notes=(*log.notes, *cut))


def _starts_as_mcap(path: Path) -> bool:
    try:
        with gzip.open(path) as packed:
            return packed.read(len(MCAP_MAGIC)) == MCAP_MAGIC
    except (EOFError, zlib.error, gzip.BadGzipFile):
        return False  # which the reader of text will name


def _unpacked_mcap(path: Path) -> RobotLog:
    """Read a compressed recording by way of a file: its reader seeks."""
    from thumper.offline.mcap_log import read_mcap

    cut: tuple[str, ...] = ()
    with TemporaryDirectory() as folder:
        unpacked = Path(folder) / path.name
        with gzip.open(path) as packed, unpacked.open("wb") as stream:
            try:
                stream.writelines(iter(packed.read1, b""))
            except (EOFError, zlib.error, gzip.BadGzipFile) as error:
                cut = (CUT.format(error),)
        try:
            log = read_mcap(unpacked)
        except ThumperError as error:
            raise ThumperError(str(error).replace(str(unpacked), str(path)), exit_code=EXIT_USAGE) from error
    return replace(log, notes=(*log.notes, *cut))


def _text(path: Path, start: bytes) -> TextIO:
    """The file line by line: a text held whole, and again as lines, would be the largest thing in memory.

    Only comments hold letters beyond ASCII, in whatever code their author used.
    """
    if start.startswith(GZIP_MAGIC):
        return gzip.open(path, "rt", encoding="utf-8-sig", errors="replace")
    return path.open(encoding="utf-8-sig", errors="replace")


def _until_cut(lines: Iterable[str], cut: list[str]) -> Iterator[str]:
    """The lines up to where a compressed file breaks off, which is noted in `cut`."""
    try:
        yield from lines
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        cut[:] = [CUT.format(error)]


def _kind(lines: Iterable[str], path: Path) -> str:
    """The format by the first line that tells it; CARMEN's may come after thousands of other lines."""
    for number, line in enumerate(line for line in lines if not line.isspace()):
        if "\0" in line:
            raise ThumperError(f"{path}: not a text log; {FORMATS}", exit_code=EXIT_USAGE)
        if is_carmen((line,)):
            return "CARMEN"
        if number == 0 and is_mines((line,)):
            return "MINES"
    return ""
