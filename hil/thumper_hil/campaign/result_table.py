"""The rows of a campaign on disk: each is there as soon as its job is done, also after a kill."""

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
    """rows.csv in a folder that belongs to one campaign, and to one program as long as it runs."""

    def __init__(self, folder: Path, digest: str) -> None:
        """Take the folder, and read what an earlier run left.

        Raises
        ------
        ThumperError
            Another program writes there, or the folder holds the rows of another campaign.
        """
        self._path = folder / "rows.csv"
        self._mark = (folder / "campaign.json").open("a+", encoding="utf-8")
        try:
            self.rows = self._take(digest)
        except ThumperError:
            self._mark.close()
            raise
        self._write_anew()
        self._stream = self._path.open("a", encoding="utf-8", newline="")
        self._writer = csv.DictWriter(self._stream, HEADER, lineterminator="\n")

    def _take(self, digest: str) -> list[CampaignRow]:
        folder = self._path.parent
        try:
            fcntl.flock(self._mark, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise ThumperError(
                f"{folder}: another campaign writes there just now; give another --out, or wait for it",
                exit_code=EXIT_USAGE,
            ) from error
        self._mark.seek(0)
        mark = self._mark.read()
        if mark and mark != _mark_of(digest):
            raise ThumperError(
                f"{folder}: holds the rows of another campaign; give another --out, or remove it",
                exit_code=EXIT_USAGE,
            )
        try:
            rows = _read(self._path) if self._path.exists() else []
        except ValueError as error:
            raise ThumperError(
                f"{self._path}: not the rows of a campaign; remove it", exit_code=EXIT_USAGE
            ) from error
        if not mark:
            self._mark.write(_mark_of(digest))
            self._mark.flush()
        return rows

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()
        self._mark.close()

    def add(self, row: CampaignRow) -> None:
        """Keep a row; when this returns it outlasts a crash."""
        self.rows.append(row)
        self._writer.writerow(asdict(row))
        self._stream.flush()
        os.fsync(self._stream.fileno())

    def _write_anew(self) -> None:
        """Drop what a kill left of a last line; the old file stays until the new one is whole."""
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
    """All rows; a last one that a kill cut off is left out. Raises ValueError for other columns or values."""
    text = path.read_text(encoding="utf-8", errors="replace")
    whole = text[: text.rfind("\n") + 1]
    reader = csv.DictReader(io.StringIO(whole))
    if whole and reader.fieldnames != HEADER:
        raise ValueError("other columns")
    rows = [_ADAPTER.validate_python(line) for line in reader]
    return list({row.key: row for row in rows}.values())
