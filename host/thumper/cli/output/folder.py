"""Check a command's output folder before the work starts."""

import fcntl
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from thumper.common.errors import EXIT_USAGE, ThumperError


def prepare_output(folder: Path, option: str = "--out") -> Path:
    """Create `folder` if needed, check that it is writable, and return it.

    `option` is the command-line option that names the folder.

    Raises
    ------
    ThumperError
        The folder cannot be created or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ThumperError(
            f"cannot write to {folder}: {os.strerror(error.errno or 0)}; choose another folder with {option}",
            exit_code=EXIT_USAGE,
        ) from error
    return folder


@contextmanager
def new_output(folder: Path) -> Iterator[None]:
    """Prepare `folder` as `prepare_output` does; remove it if it is new and the work fails without a file."""
    new = [path for path in (folder, *folder.parents) if not path.exists()]
    prepare_output(folder)
    try:
        yield
    except BaseException:
        with suppress(OSError):  # there are files in it
            for path in new:
                path.rmdir()
        raise


@contextmanager
def reserved(folder: Path) -> Iterator[None]:
    """Keep other robot processes away from an existing `folder`; the lock ends with this process.

    Raises
    ------
    ThumperError
        Another robot process has reserved it.
    """
    lock = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise ThumperError(
                f"another robot process writes to {folder}; stop it, or choose another folder with --out",
                exit_code=EXIT_USAGE,
            ) from error
        yield
    finally:
        os.close(lock)
