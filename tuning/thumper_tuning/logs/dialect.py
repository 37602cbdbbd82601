"""Find the header of a text table and its separator, by what the rows below it hold."""

import csv
import math
import re
from dataclasses import dataclass, replace

from thumper_tuning.logs.columns import is_known, parse_header
from thumper_tuning.logs.numbers import is_bare_number, to_number

SEPARATORS = (",", ";", "\t", "|", " ")
MAX_PREAMBLE_LINES = 50
ROWS_COMPARED = 20
MIN_NUMERIC_ROWS = 0.5  # of the rows below the header
COMMENT = ("#", "%", "//")


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """Where the rows begin, how their cells are separated, and the names of the columns."""

    separator: str
    headers: tuple[str, ...]
    first_row: int  # index into the lines
    known: int  # headers that name a quantity


def find_dialect(lines: list[str]) -> Dialect | None:
    """Return the dialect of the first header with two known names, else of the first line above numbers.

    A file of numbers alone gets the headers 1, 2, ...
    """
    unnamed: Dialect | None = None
    for number, line in enumerate(lines[:MAX_PREAMBLE_LINES]):
        found = [d for separator in SEPARATORS if (d := _read_header(line, separator, lines, number))]
        best = max(found, key=lambda dialect: dialect.known, default=None)
        if best is not None and best.known >= 2:
            return _with_unit_row(best, lines)
        if unnamed is None and best is not None and not (is_comment(line) and best.known == 0):
            first = split_cells(lines[number + 1], best.separator)
            unnamed = best if _is_numeric(first, len(best.headers)) else None
    return unnamed or _without_header([line for line in lines if not is_comment(line)])


def is_comment(line: str) -> bool:
    """Return whether the line begins as a comment; so may the header, as numpy's `savetxt` writes it."""
    return line.lstrip().startswith(COMMENT)


def misfit(lines: list[str]) -> str:
    """Return what is wrong with a table whose rows do not fit its header; empty: it has no header."""
    for number, line in enumerate(lines[:MAX_PREAMBLE_LINES]):
        headers, rows = split_cells(line, ","), lines[number + 1 : number + 1 + ROWS_COMPARED]
        wider = [row for row in rows if len(split_cells(row, ",")) > len(headers) + 1]
        if sum(map(is_known, headers)) >= 2 and 2 * len(wider) > len(rows):
            return (
                f"the rows have more cells than the {len(headers)} names in line {number + 1}: if commas are "
                "also the decimal signs, separate the columns by semicolons"
            )
    return ""


def _read_header(line: str, separator: str, lines: list[str], number: int) -> Dialect | None:
    following = [row for row in lines[number + 1 : number + 1 + ROWS_COMPARED] if not is_comment(row)]
    rows = [split_cells(row, separator) for row in following]
    headers = split_cells(line, separator)
    if separator == " " and rows and len(headers) != len(rows[-1]):
        headers = re.split(r"\s{2,}", line.strip())  # names of several words, aligned
    if len(headers) < 2 or not rows or any(map(is_bare_number, headers)):
        return None
    if sum(_is_numeric(row, len(headers)) for row in rows) < MIN_NUMERIC_ROWS * len(rows):
        return None
    return Dialect(
        separator=separator,
        headers=tuple(headers),
        first_row=number + 1,
        known=sum(map(is_known, headers)),
    )


def _with_unit_row(dialect: Dialect, lines: list[str]) -> Dialect:
    """Take the units of a row below the header, as `[s];[1/min];[%]`, into the headers."""
    cells = split_cells(lines[dialect.first_row], dialect.separator)
    if len(cells) != len(dialect.headers) or any(map(is_bare_number, cells)):
        return dialect
    headers = with_units(dialect.headers, [cell.strip("[]() ") for cell in cells])
    changed = [parse_header(h, k) for k, h in enumerate(headers) if h != dialect.headers[k]]
    if not any(column and column.unit_given and not column.unknown_unit for column in changed):
        return dialect  # text, or missing values
    return replace(dialect, headers=headers, first_row=dialect.first_row + 1)


def with_units(headers: tuple[str, ...], units: list[str]) -> tuple[str, ...]:
    """Return the headers with the units that they do not name themselves."""
    columns = [parse_header(header, k) for k, header in enumerate(headers)]
    return tuple(
        f"{header} [{unit}]" if unit and column is not None and not column.unit_given else header
        for header, unit, column in zip(headers, units, columns, strict=True)
    )


def _is_numeric(row: list[str], columns: int) -> bool:
    """Return whether a row has about as many cells as the header, and numbers in half of the filled ones."""
    filled = [cell for cell in row if cell]
    numbers = sum(math.isfinite(to_number(cell)) for cell in filled)
    return abs(len(row) - columns) <= 1 and bool(filled) and 2 * numbers >= len(filled)


def _without_header(lines: list[str]) -> Dialect | None:
    for separator in SEPARATORS:
        rows = [split_cells(line, separator) for line in lines[:ROWS_COMPARED]]
        columns = len(rows[0]) if rows else 0
        if columns >= 2 and all(len(row) == columns and _is_numeric(row, columns) for row in rows):
            headers = tuple(str(k + 1) for k in range(columns))
            return Dialect(separator=separator, headers=headers, first_row=0, known=0)
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
