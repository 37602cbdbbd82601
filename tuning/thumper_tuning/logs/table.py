"""Read a table of numbers from a text file with any separator, decimal sign and preamble."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thumper.common.errors import EXIT_CHECK_FAILED, EXIT_USAGE, ThumperError
from thumper.common.files import read_bytes
from thumper.common.geometry import FloatArray
from thumper_tuning.logs.columns import Quantity, parse_header
from thumper_tuning.logs.dialect import SEPARATORS, find_dialect, split_cells, to_number
from thumper_tuning.logs.serial_monitor import pairs_to_rows, split_stamps

MAX_MB = 200.0  # an hour at 100 Hz takes 20


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LogTable:
    """All columns of a file: their headers, and their values as in the file, shape (n, len(headers))."""

    headers: tuple[str, ...]
    values: FloatArray
    notes: tuple[str, ...] = ()


def read_table(path: Path) -> LogTable:
    """Read a CSV file; cells that are not numbers become NaN.

    Raises
    ------
    ThumperError
        The file cannot be read, or holds no table of numbers.
    """
    lines = [line for line in _read_text(path).splitlines() if line.strip() and not _is_comment(line)]
    lines, stamps_s = split_stamps(lines)
    if (rows_of_pairs := pairs_to_rows(lines)) is not None:
        lines = rows_of_pairs
        stamps_s = None if stamps_s is None else np.append(np.nan, stamps_s)  # the header has none
    dialect = find_dialect(lines)
    if dialect is None:
        raise ThumperError(
            f"{path}: no line names the columns; add one on top, for example time_s,pwm,counts",
            exit_code=EXIT_CHECK_FAILED,
        )
    rows = [split_cells(line, dialect.separator) for line in lines[dialect.first_row :]]
    values = np.full((len(rows), len(dialect.headers)), np.nan)
    for k, row in enumerate(rows):
        for j, cell in enumerate(row[: len(dialect.headers)]):
            values[k, j] = to_number(cell)
    headers = dialect.headers
    if stamps_s is not None and not any(_is_time(header) for header in headers):
        headers = ("timestamp_s", *headers)
        values = np.column_stack((stamps_s[dialect.first_row :], values))
    return LogTable(headers=headers, values=values)


def _is_time(header: str) -> bool:
    column = parse_header(header, 0)
    return column is not None and column.quantity is Quantity.TIME


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
    return not any(
        len(cells := split_cells(stripped, separator)) > 1
        and sum(parse_header(cell, 0) is not None for cell in cells) > 1
        for separator in SEPARATORS
    )
