"""Read files of limited size, and write files that appear whole or not at all."""

import csv
import errno
import io
import os
import re
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from thumper.common.errors import EXIT_USAGE, ThumperError

MAX_LINE_BYTES = 64_000
LONG_LINE = re.compile(rb"[^\r\n]{%d}" % (MAX_LINE_BYTES + 1))
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def unreadable(path: Path, error: OSError) -> ThumperError:
    """Return the error for a file that a user named and that cannot be read."""
    return ThumperError(f"{path}: cannot be read ({error.strerror}); check the path", exit_code=EXIT_USAGE)


@contextmanager
def open_regular(path: Path) -> Iterator[IO[bytes]]:
    """Open a regular file to read.

    Raises OSError for any other: a pipe would block, and a device such as /dev/zero never ends.
    """
    with open(path, "rb", opener=_open_at_once) as stream:
        if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
            raise OSError(errno.EINVAL, "not a regular file", str(path))
        yield stream


def read_bytes(path: Path, limit_MB: float) -> bytes:
    """Return the content of a regular file; raise OSError if it is larger than the limit."""
    limit = int(1e6 * limit_MB)
    with open_regular(path) as stream:
        if os.fstat(stream.fileno()).st_size > limit or len(content := stream.read(limit + 1)) > limit:
            raise OSError(errno.EFBIG, f"larger than {limit_MB:g} MB", str(path))
    return content


def read_text(path: Path, limit_MB: float) -> str:
    """Return a UTF-8 text file; raise OSError as `read_bytes`, or UnicodeDecodeError."""
    return read_bytes(path, limit_MB).decode("utf-8")


def read_table_bytes(path: Path, limit_MB: float) -> bytes:
    """Return the content of a text file with a table; raise OSError also for a line no table has.

    What guesses separators and names takes minutes for it.
    """
    content = read_bytes(path, limit_MB)
    if found := LONG_LINE.search(content):
        line = content.count(b"\n", 0, found.start()) + 1
        raise OSError(errno.EFBIG, f"line {line} is longer than {MAX_LINE_BYTES / 1000:g} kB", str(path))
    return content


@contextmanager
def write_whole(path: Path) -> Iterator[IO[bytes]]:
    """Open a file to write. It replaces `path` at the end; after an error the old file is still there.

    Raises
    ------
    ThumperError
        The file cannot be written, for example because the disk is full.
    """
    partial = path.with_name(path.name + ".part")
    try:
        with partial.open("wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(path)
        sync_folder(path.parent)
    except BaseException as error:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise cannot_write(path, error) from error
        raise


def sync_folder(folder: Path) -> None:
    """Write a folder's entries to the disk, after a file was renamed."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file whole. Raises ThumperError as `write_whole`."""
    with write_whole(path) as stream:
        stream.write(text.encode("utf-8"))


def write_csv(path: Path, header: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    """Write a CSV file whole. Raises ThumperError as `write_whole`."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    write_text(path, text.getvalue())


def cannot_write(path: Path, error: OSError) -> ThumperError:
    """Return the error of a file that cannot be written, with the fix."""
    fix = "free some space" if error.errno in FULL else "check the folder"
    return ThumperError(f"{path}: cannot be written ({error.strerror}); {fix}", exit_code=EXIT_USAGE)


def _open_at_once(name: str, flags: int) -> int:
    return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))  # otherwise opening a pipe waits for a writer
