"""Store a campaign's rows on disk: each is saved when its job ends, so a crash loses none."""

import csv
import fcntl
import io
import json
import os
from dataclasses import asdict, fields
from pathlib import Path
from typing import Self

from pydantic import TypeAdapter

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper_hil.campaign.result_row import CampaignRow

_ADAPTER = TypeAdapter(CampaignRow)
HEADER = [field.name for field in fields(CampaignRow)]


class RowStore:
    """rows.csv in a folder that belongs to one campaign; one process at a time may open it."""

    def __init__(self, folder: Path, digest: str) -> None:
        """Lock the folder and read the rows of earlier runs.

        Raises
        ------
        ThumperError
            Another process writes to the folder, or it contains the rows of another campaign.
        """
        self._path = folder / "rows.csv"
        self._lock_file = (folder / "campaign.json").open("a+", encoding="utf-8")
        try:
            self.rows = self._lock_and_read(digest)
        except ThumperError:
            self._lock_file.close()
            raise
        self._rewrite()
        self._stream = self._path.open("a", encoding="utf-8", newline="")
        self._writer = csv.DictWriter(self._stream, HEADER, lineterminator="\n")

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
        mark = self._lock_file.read()
        if mark and mark != _mark_of(digest):
            raise ThumperError(
                f"{folder}: contains the rows of another campaign; pass another --out, or delete it",
                exit_code=EXIT_USAGE,
            )
        try:
            rows = _read(self._path) if self._path.exists() else []
        except ValueError as error:
            raise ThumperError(
                f"{self._path}: not the rows of a campaign; delete the file", exit_code=EXIT_USAGE
            ) from error
        if not mark:
            self._lock_file.write(_mark_of(digest))
            self._lock_file.flush()
        return rows

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()
        self._lock_file.close()

    def add(self, row: CampaignRow) -> None:
        """Append a row and flush it to disk."""
        self.rows.append(row)
        self._writer.writerow(asdict(row))
        self._stream.flush()
        os.fsync(self._stream.fileno())

    def _rewrite(self) -> None:
        """Drop an incomplete last line; the old file stays until the new one is complete."""
        new = self._path.with_suffix(".new")
        with new.open("w", encoding="utf-8", newline="") as stream:
            writer = csv.DictWriter(stream, HEADER, lineterminator="\n")
            writer.writeheader()
            writer.writerows(asdict(row) for row in self.rows)
            stream.flush()
            os.fsync(stream.fileno())
        new.replace(self._path)


def _mark_of(digest: str) -> str:
    return json.dumps({"digest": digest}) + "\n"


def _read(path: Path) -> list[CampaignRow]:
    """Return all complete rows; raise ValueError for wrong columns or values."""
    text = path.read_text(encoding="utf-8", errors="replace")
    complete = text[: text.rfind("\n") + 1]
    reader = csv.DictReader(io.StringIO(complete))
    if complete and reader.fieldnames != HEADER:
        raise ValueError("wrong columns")
    rows = [_ADAPTER.validate_python(line) for line in reader]
    return list({row.key: row for row in rows}.values())
