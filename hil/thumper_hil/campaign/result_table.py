"""Store a campaign's rows on disk: each is saved when its job ends, so a crash loses none."""

import csv
import fcntl
import io
import json
import os
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import asdict, fields
from io import FileIO
from pathlib import Path
from typing import Self

from pydantic import TypeAdapter

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import cannot_write, read_bytes, write_whole
from thumper_hil.campaign.result_row import CampaignRow

_ADAPTER = TypeAdapter(CampaignRow)
HEADER = [field.name for field in fields(CampaignRow)]
MAX_MB = 100.0  # a million drives
MAX_MARK_BYTES = 1000


class RowStore:
    """rows.csv in a folder that belongs to one campaign; one process at a time may open it."""

    def __init__(self, folder: Path, digest: str) -> None:
        """Lock the folder and read the rows of earlier runs.

        Raises
        ------
        ThumperError
            Another process writes to the folder, it contains the rows of another campaign, or the disk is
            full.
        """
        self._path = folder / "rows.csv"
        lock_path = folder / "campaign.json"
        with ExitStack() as stack:
            try:
                self._lock_file = stack.enter_context(lock_path.open("ab+", buffering=0))
                self.rows = self._lock_and_read(digest)
                self._rewrite()
                self._stream = stack.enter_context(self._path.open("ab", buffering=0))
            except OSError as error:
                raise cannot_write(lock_path, error) from error
            self._open_files = stack.pop_all()

    def _lock_and_read(self, digest: str) -> list[CampaignRow]:
        folder = self._path.parent
        try:
            fcntl.flock(self._lock_file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise ThumperError(
                f"{folder}: another campaign is writing to this folder; pass another --out, or wait for it",
                exit_code=EXIT_USAGE,
            ) from error
        self._lock_file.seek(0)
        mark = self._lock_file.read(MAX_MARK_BYTES)
        if mark and mark != _mark_of(digest):
            raise ThumperError(
                f"{folder}: contains the rows of another campaign; pass another --out, or delete it",
                exit_code=EXIT_USAGE,
            )
        try:
            rows = _read(self._path) if self._path.exists() else []
        except (OSError, ValueError, csv.Error) as error:
            reason = f" ({error.strerror})" if isinstance(error, OSError) else ""
            raise ThumperError(
                f"{self._path}: not the rows of a campaign{reason}; delete the file", exit_code=EXIT_USAGE
            ) from error
        if not mark:
            _append(self._lock_file, _mark_of(digest))
        return rows

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._open_files.close()

    def add(self, row: CampaignRow) -> None:
        """Append a row and flush it to disk; raise ThumperError if the disk is full."""
        try:
            _append(self._stream, _to_csv([row]))
        except OSError as error:
            raise cannot_write(self._path, error) from error
        self.rows.append(row)

    def _rewrite(self) -> None:
        """Drop an incomplete last line; the old file stays until the new one is complete."""
        with write_whole(self._path) as stream:
            stream.write(",".join(HEADER).encode() + b"\n" + _to_csv(self.rows))


def _mark_of(digest: str) -> bytes:
    return json.dumps({"digest": digest}).encode() + b"\n"


def _to_csv(rows: Iterable[CampaignRow]) -> bytes:
    text = io.StringIO()
    csv.DictWriter(text, HEADER, lineterminator="\n").writerows(asdict(row) for row in rows)
    return text.getvalue().encode()


def _append(stream: FileIO, content: bytes) -> None:
    """Append all or nothing, and flush it to disk."""
    end = stream.seek(0, os.SEEK_END)
    try:
        while content:  # an almost full disk takes a part first
            content = content[stream.write(content) :]
        os.fsync(stream.fileno())
    except OSError:
        stream.truncate(end)
        raise


def _read(path: Path) -> list[CampaignRow]:
    """Return all complete rows; raise ValueError for wrong columns or values."""
    text = read_bytes(path, MAX_MB).decode("utf-8", errors="replace")
    complete = text[: text.rfind("\n") + 1]
    reader = csv.DictReader(io.StringIO(complete))
    if complete and reader.fieldnames != HEADER:
        raise ValueError("wrong columns")
    rows = [_ADAPTER.validate_python(line) for line in reader]
    return list({row.key: row for row in rows}.values())
