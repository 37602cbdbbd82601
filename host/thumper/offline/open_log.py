"""Open a robot log; its content decides the format."""

import gzip
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TextIO

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import open_regular, unreadable
from thumper.common.texts import is_number
from thumper.offline import carmen, mines_paristech
from thumper.offline.robot_log import RobotLog, TextLogFormat, refuse_fov

TEXT_FORMATS: tuple[TextLogFormat, ...] = (carmen, mines_paristech)
FORMATS = "pass a CARMEN (.log, .clf), MINES (.dat) or MCAP log"
GZIP_MAGIC = b"\x1f\x8b"
GZIP_ERRORS = (EOFError, zlib.error, gzip.BadGzipFile)
TRUNCATED = "the compressed file is cut off or damaged; it is used up to there ({})"
MCAP_MAGIC = b"\x89MCAP0\r\n"
# First bytes of files that are passed by mistake.
OTHER_FILES = {
    b"#ROSBAG V2.0": "a ROS 1 bag: convert it to MCAP with rosbags-convert",
    b"SQLite format 3": "a ROS 2 bag in SQLite: convert it to MCAP with ros2 bag convert",
    b"PK\x03\x04": "a ZIP archive: unpack it",
    b"BZh": "packed with bzip2: unpack it",
    b"\xfd7zXZ": "packed with xz: unpack it",
    b"\x28\xb5\x2f\xfd": "packed with zstd: unpack it",
    b"\x89PNG": "a picture",
    b"\xff\xd8\xff": "a picture",
    b"P5": "a map (.pgm), not a drive",
    b"%PDF": "a PDF document",
    b"\x7fELF": "a program",
    b'{"thumper_session"': "a saved session: pass it with --session",
    b"image:": "a map (.yaml), not a drive",
    b"<": "an HTML or XML page: was the download refused?",
}
MAX_LINE = 1_000_000
MAX_TEXT = 2_000_000_000
MAX_RATIO = 100  # between an MCAP file and its compressed form


def open_log(path: Path, fov_rad: float | None = None) -> RobotLog:
    """Read a CARMEN, MINES or MCAP log, plain or gzip-compressed: the content decides.

    `fov_rad` is the laser's field of view, for a CARMEN log that does not contain it. A truncated compressed
    file is read up to its end, with a note.

    Raises
    ------
    ThumperError
        The file cannot be read, has none of these formats, or contains its field of view itself.
    """
    try:
        with open_regular(path) as plain:
            start = plain.read(len(MCAP_MAGIC))
        if start == MCAP_MAGIC or (start.startswith(GZIP_MAGIC) and _is_packed_mcap(path)):
            refuse_fov(str(path), fov_rad, "an MCAP log")
            return _read_mcap(path, packed=start != MCAP_MAGIC)
        return _read_text(path, fov_rad, packed=start.startswith(GZIP_MAGIC))
    except FileNotFoundError as error:
        raise unreadable(path, error) from error
    except IsADirectoryError as error:
        raise ThumperError(f"{path}: is a directory; pass a log file", exit_code=EXIT_USAGE) from error
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot be read ({error}); check the file and its permissions", exit_code=EXIT_USAGE
        ) from error


def _is_packed_mcap(path: Path) -> bool:
    try:
        with gzip.open(path) as packed:
            return packed.read(len(MCAP_MAGIC)) == MCAP_MAGIC
    except GZIP_ERRORS:
        return False  # the reader of text reports it


def _read_mcap(path: Path, *, packed: bool) -> RobotLog:
    """Read a recording; unpack a compressed one to a file first, because the reader seeks."""
    from thumper.offline.mcap_log import read_mcap  # deferred: loads the ROS 2 types

    if not packed:
        return read_mcap(path)
    truncated: tuple[str, ...] = ()
    with TemporaryDirectory() as folder:
        unpacked = Path(folder) / path.name
        limit = MAX_RATIO * path.stat().st_size
        with gzip.open(path) as source, unpacked.open("wb") as stream:
            try:
                for block in iter(source.read1, b""):
                    stream.write(block)
                    if stream.tell() > limit:
                        raise ThumperError(
                            f"{path}: unpacks to more than {MAX_RATIO} times its size; if it is a recording, "
                            "unpack it first",
                            exit_code=EXIT_USAGE,
                        )
            except GZIP_ERRORS as error:
                truncated = (TRUNCATED.format(error),)
        try:
            log = read_mcap(unpacked)
        except ThumperError as error:
            raise ThumperError(str(error).replace(str(unpacked), str(path)), exit_code=EXIT_USAGE) from error
    return replace(log, notes=(*log.notes, *truncated))


def _read_text(path: Path, fov_rad: float | None, *, packed: bool) -> RobotLog:
    truncated: list[str] = []
    with _open_text(path, packed) as stream:
        text_format = _detect(_until_truncated(_lines(stream, path), truncated), path, packed)
    if text_format is None:
        problem = f"{truncated[0]}; copy it again" if truncated else f"{_what_it_is(path, packed)}; {FORMATS}"
        raise ThumperError(f"{path}: {problem}", exit_code=EXIT_USAGE)
    with _open_text(path, packed) as stream:
        log = text_format.read(str(path), _until_truncated(_lines(stream, path), truncated), fov_rad)
    return replace(log, notes=(*log.notes, *truncated))


def _open_text(path: Path, packed: bool) -> TextIO:
    """Open the file to read it line by line, because the whole text would take the most memory of all.

    Only comments contain characters beyond ASCII, in any encoding.
    """
    if packed:
        return gzip.open(path, "rt", encoding="utf-8-sig", errors="replace")
    return path.open(encoding="utf-8-sig", errors="replace")


def _lines(stream: TextIO, path: Path) -> Iterator[str]:
    """Yield the lines. A small compressed file may unpack to anything, so line and text have limits."""
    size = 0
    for number, line in enumerate(iter(lambda: stream.readline(MAX_LINE), ""), start=1):
        size += len(line)
        if size > MAX_TEXT or (len(line) == MAX_LINE and not line.endswith("\n")):
            problem = f"line {number} is longer than {MAX_LINE} characters"
            if size > MAX_TEXT:
                problem = f"has more than {MAX_TEXT} characters"
            raise ThumperError(f"{path}: {problem}: no robot log; {FORMATS}", exit_code=EXIT_USAGE)
        yield line


def _until_truncated(lines: Iterable[str], truncated: list[str]) -> Iterator[str]:
    """Yield the lines of a compressed file up to its damage, which is noted in `truncated`."""
    try:
        yield from lines
    except GZIP_ERRORS as error:
        truncated[:] = [TRUNCATED.format(error)]


def _detect(lines: Iterable[str], path: Path, packed: bool) -> TextLogFormat | None:
    """Return the format of the first line that identifies one; thousands of lines may precede it."""
    for number, line in enumerate(line for line in lines if not line.isspace()):
        if "\0" in line:
            raise ThumperError(f"{path}: {_what_it_is(path, packed)}; {FORMATS}", exit_code=EXIT_USAGE)
        for text_format in TEXT_FORMATS:
            if text_format.recognizes(line, is_first=number == 0):
                return text_format
    return None


def _what_it_is(path: Path, packed: bool) -> str:
    """Name a file that no reader recognizes."""
    with (gzip.open if packed else open)(path, "rb") as stream:
        start: bytes = stream.read(4096)
    if not start.strip():
        return "the file is empty"
    for magic, name in OTHER_FILES.items():
        if start.lstrip().startswith(magic):
            return f"not a log but {name}"
    if b"\0" in start:
        return "not a text log"
    line = start.decode(errors="replace").strip().splitlines()[0]
    fields = line.replace(",", " ").replace(";", " ").split()
    if all(is_number(field) for field in fields):
        return (
            f"unknown log format: the first line has {len(fields)} numbers, and a MINES log has 706 per line"
        )
    return f"unknown log format: the first line starts with {line[:20]!r}, and a CARMEN log has FLASER lines"
