"""The rows of a campaign on disk: each is there as soon as its job is done, also after a kill."""

import csv
import io
import json
import os
from dataclasses import asdict, fields
from pathlib import Path
from typing import Self

from pydantic import TypeAdapter, ValidationError

from thumper.errors import ThumperError
from thumper_hil.campaign.job import Row

_ADAPTER = TypeAdapter(Row)
HEADER = [field.name for field in fields(Row)]


class RowStore:
    """rows.csv in a folder that belongs to one campaign. Only one program may write there."""

    def __init__(self, folder: Path, digest: str) -> None:
        """Take the folder, and read what an earlier run left.

        Raises
        ------
        ThumperError
            The folder holds the rows of another campaign.
        """
        self._path = folder / "rows.csv"
        mark = folder / "campaign.json"
        if mark.exists() and json.loads(mark.read_text(encoding="utf-8"))["digest"] != digest:
            raise ThumperError(
                f"{folder}: holds the rows of another campaign; give another --out, or remove it", exit_code=2
            )
        try:
            self.rows = _read(self._path) if self._path.exists() else []
        except ValidationError as error:
            raise ThumperError(f"{self._path}: not the rows of a campaign; remove it", exit_code=2) from error
        mark.write_text(json.dumps({"digest": digest}) + "\n", encoding="utf-8")
        self._write_anew()
        self._stream = self._path.open("a", encoding="utf-8", newline="")
        self._writer = csv.DictWriter(self._stream, HEADER, lineterminator="\n")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def add(self, row: Row) -> None:
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


def _read(path: Path) -> list[Row]:
    """All rows; a last one that a kill cut off is left out."""
    text = path.read_text(encoding="utf-8", errors="replace")
    whole = text[: text.rfind("\n") + 1]
    rows = [_ADAPTER.validate_python(line) for line in csv.DictReader(io.StringIO(whole))]
    return list({row.key: row for row in rows}.values())
