"""Find the header of a text table and its separator, by what the rows below it hold."""

import csv
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from thumper_tuning.logs.columns import parse_header

SEPARATORS = (",", ";", "\t", "|", " ")
MAX_PREAMBLE_LINES = 50
ROWS_COMPARED = 20
MIN_NUMERIC_ROWS = 0.5  # of the rows below the header


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """Where the rows begin, how their cells are separated, and the names of the columns."""

    separator: str
    headers: tuple[str, ...]
    first_row: int  # index into the lines
    recognized: int  # headers that name a quantity


def find_dialect(lines: list[str]) -> Dialect | None:
    """Return the dialect of the first header with two known names, else of the first line above numbers.

    A file of numbers alone gets the headers 1, 2, ...
    """
    unnamed: Dialect | None = None
    for number, line in enumerate(lines[:MAX_PREAMBLE_LINES]):
        found = [d for separator in SEPARATORS if (d := _read_header(line, separator, lines, number))]
        best = max(found, key=lambda dialect: dialect.recognized, default=None)
        if best is not None and best.recognized >= 2:
            return _with_unit_row(best, lines)
        unnamed = unnamed or best
    return unnamed or _without_header(lines)


def _read_header(line: str, separator: str, lines: list[str], number: int) -> Dialect | None:
    headers = split_cells(line, separator)
    rows = [split_cells(row, separator) for row in lines[number + 1 : number + 1 + ROWS_COMPARED]]
    if len(headers) < 2 or not rows or any(np.isfinite(to_number(cell)) for cell in headers):
        return None
    if not any(_is_numeric(row, len(headers)) for row in rows):
        return None
    if sum(_is_numeric(row, len(headers)) for row in rows) < MIN_NUMERIC_ROWS * len(rows):
        return None
    recognized = sum(parse_header(header, 0) is not None for header in headers)
    return Dialect(separator=separator, headers=tuple(headers), first_row=number + 1, recognized=recognized)


def _with_unit_row(dialect: Dialect, lines: list[str]) -> Dialect:
    """Take the units of a row below the header, as `[s];[1/min];[%]`, into the headers."""
    cells = split_cells(lines[dialect.first_row], dialect.separator)
    if len(cells) != len(dialect.headers) or any(np.isfinite(to_number(cell)) for cell in cells):
        return dialect
    headers = list(dialect.headers)
    for k, cell in enumerate(cells):
        before = parse_header(headers[k], k)
        unit = cell.strip("[]() ")
        if unit and before is not None and not before.unit_given:
            headers[k] += f" [{unit}]"
    changed = [parse_header(h, k) for k, h in enumerate(headers) if h != dialect.headers[k]]
    if not any(column and column.unit_given and not column.unknown_unit for column in changed):
        return dialect  # text, or missing values
    return replace(dialect, headers=tuple(headers), first_row=dialect.first_row + 1)


def _is_numeric(row: list[str], columns: int) -> bool:
    """Return whether a row has about as many cells as the header, and numbers in half of the filled ones."""
    filled = [cell for cell in row if cell]
    numbers = sum(bool(np.isfinite(to_number(cell))) for cell in filled)
    return abs(len(row) - columns) <= 1 and bool(filled) and 2 * numbers >= len(filled)


def _without_header(lines: list[str]) -> Dialect | None:
    for separator in SEPARATORS:
        rows = [split_cells(line, separator) for line in lines[:ROWS_COMPARED]]
        columns = len(rows[0]) if rows else 0
        if columns >= 2 and all(len(row) == columns and _is_numeric(row, columns) for row in rows):
            headers = tuple(str(k + 1) for k in range(columns))
            return Dialect(separator=separator, headers=headers, first_row=0, recognized=0)
    return None


def split_cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line, without blanks around them and marks of a comment before them."""
    line = line.lstrip("#%/ ")
    if separator == " ":
        return line.split()
    try:
        row = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    except csv.Error:  # a cell of more than 131072 characters
        return []
    return [cell.strip() for cell in row]


def to_number(text: str) -> float:
    """Return a number, also with a decimal comma, or the seconds of an ISO date or time of day; else NaN."""
    text = text.strip()
    try:
        return float(text)
    except ValueError:
        pass
    if ":" in text:
        date = "" if "-" in text[1:] else "1970-01-01 "
        try:
            return datetime.fromisoformat(date + text).timestamp()
        except ValueError:
            return float("nan")
    try:
        return float(text.replace(",", ".")) if text.count(",") == 1 else float("nan")
    except ValueError:
        return float("nan")
