"""Read a table of numbers from a text file with any separator, decimal sign and preamble."""

import csv
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from thumper.common.errors import EXIT_CHECK_FAILED, EXIT_USAGE, ThumperError
from thumper.common.files import read_bytes
from thumper.common.geometry import FloatArray
from thumper_tuning.logs.columns import Column, parse_header

SEPARATORS = (",", ";", "\t", "|", " ")
MAX_PREAMBLE_LINES = 50
MAX_MB = 200.0  # an hour at 100 Hz takes 20


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Table:
    """The recognized columns, and their values as in the file, shape (n, len(columns))."""

    columns: tuple[Column, ...]
    values: FloatArray
    headers: tuple[str, ...]


def read_table(path: Path) -> Table:
    """Read a CSV file; cells that are not numbers become NaN.

    Raises
    ------
    ThumperError
        The file cannot be read, or no line names columns of a motor log.
    """
    lines = [line for line in _read_text(path).splitlines() if line.strip() and not _is_comment(line)]
    for number, line in enumerate(lines[:MAX_PREAMBLE_LINES]):
        for separator in SEPARATORS:
            headers = _cells(line, separator)
            if len(headers) < 2 or sum(_number(cell) == _number(cell) for cell in headers) > 0:
                continue
            columns = [column for i, text in enumerate(headers) if (column := parse_header(text, i))]
            if len(columns) >= 2:
                return _parse_rows(lines[number + 1 :], separator, headers, columns)
    raise ThumperError(
        f"{path}: no line names the columns; add one on top, for example time_s,pwm,counts",
        exit_code=EXIT_CHECK_FAILED,
    )


def _parse_rows(lines: list[str], separator: str, headers: list[str], columns: list[Column]) -> Table:
    rows = [_cells(line, separator) for line in lines]
    values = np.full((len(rows), len(columns)), np.nan)
    for k, row in enumerate(rows):
        for j, column in enumerate(columns):
            if column.index < len(row):
                values[k, j] = _number(row[column.index])
    return Table(columns=tuple(columns), values=values, headers=tuple(headers))


def _read_text(path: Path) -> str:
    try:
        data = read_bytes(path, MAX_MB)
    except OSError as error:
        raise ThumperError(f"{path}: cannot read the log: {error.strerror}", exit_code=EXIT_USAGE) from error
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _is_comment(line: str) -> bool:
    """Return whether the line is a comment. numpy's savetxt writes the header as one: that is none."""
    stripped = line.lstrip()
    if not stripped.startswith(("#", "%", "//")):
        return False
    bare = stripped.lstrip("#%/ ")
    return not any(
        len(cells := _cells(bare, separator)) > 1 and sum(_is_known_header(cell) for cell in cells) > 1
        for separator in SEPARATORS
    )


def _is_known_header(header: str) -> bool:
    try:
        return parse_header(header, 0) is not None
    except ThumperError:
        return False


def _cells(line: str, separator: str) -> list[str]:
    line = line.lstrip("#%/ ")
    if separator == " ":
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator))]
    except csv.Error:  # a cell of more than 131072 characters
        return []


def _number(text: str) -> float:
    text = text.strip()
    try:
        return float(text)
    except ValueError:
        pass
    if "-" in text[1:] and ":" in text:
        try:
            return datetime.fromisoformat(text).timestamp()
        except ValueError:
            return np.nan
    try:  # a decimal comma
        return float(text.replace(",", ".")) if text.count(",") == 1 else np.nan
    except ValueError:
        return np.nan
