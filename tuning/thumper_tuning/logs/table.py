"""Read a table of numbers from a text file with any separator, decimal sign and preamble."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import read_table_bytes, unreadable
from thumper.common.geometry import FloatArray
from thumper_tuning.logs.column_names import Quantity
from thumper_tuning.logs.columns import is_known, parse_header
from thumper_tuning.logs.dialect import SEPARATORS, find_dialect, is_comment, misfit, split_cells, with_units
from thumper_tuning.logs.numbers import read_columns
from thumper_tuning.logs.serial_monitor import pairs_to_rows, plotted_to_rows, split_stamps

MAX_MB = 200.0  # an hour at 100 Hz takes 20


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LogTable:
    """All columns of a file: their headers, and their values as in the file, shape (n, len(headers))."""

    headers: tuple[str, ...]
    values: FloatArray
    notes: tuple[str, ...] = ()
    drive_notes: Mapping[str, str] = field(default_factory=dict)  # of the motor with the drive of this header


def read_table(path: Path) -> LogTable:
    """Read a CSV file; cells that are not numbers become NaN.

    Raises
    ------
    ThumperError
        The file cannot be read, or holds no table of numbers.
    """
    texts = list(_decoded(_content(path)))
    found = [(lines, find_dialect(lines), stamps_s) for lines, stamps_s in map(_lines, texts)]
    lines, dialect, stamps_s = max(found, key=lambda one: one[1].known if one[1] is not None else -1)
    if dialect is None:
        wrong = misfit(lines) or "no line names the columns; add one on top, for example time_s,pwm,counts"
        raise ThumperError(f"{path}: {wrong}", exit_code=EXIT_USAGE)
    kept = [k for k in range(dialect.first_row, len(lines)) if not is_comment(lines[k])]
    rows = [split_cells(lines[k], dialect.separator) for k in kept]
    columns = [[row[j] if j < len(row) else "" for row in rows] for j in range(len(dialect.headers))]
    parsed = read_columns(columns, dialect.separator)
    headers = with_units(dialect.headers, [unit for _, unit in parsed])
    if columns and not headers[0] and any(":" in cell for cell in columns[0]):
        headers = ("time", *headers[1:])  # the index of a pandas table
    values = np.array([numbers for numbers, _ in parsed]).reshape(len(headers), len(rows)).T
    if stamps_s is not None and not any(_is_time(header) for header in headers):
        headers = ("timestamp_s", *headers)
        values = np.column_stack((stamps_s[kept], values))
    return LogTable(headers=headers, values=values)


def _lines(text: str) -> tuple[list[str], FloatArray | None]:
    """Return the lines of the table, and the stamps of a serial monitor before them [s]."""
    lines = [line for line in text.splitlines() if line.strip()]
    first = next((k for k, line in enumerate(lines) if not is_comment(line)), 0)
    lines = [line for k, line in enumerate(lines) if k < first or not is_comment(line) or _is_header(line)]
    lines, stamps_s = split_stamps(lines)
    rows_of_pairs = pairs_to_rows(lines) or plotted_to_rows(lines)
    if rows_of_pairs is None:
        return lines, stamps_s
    return rows_of_pairs, None if stamps_s is None else np.append(np.nan, stamps_s)  # the header has none


def _is_header(line: str) -> bool:
    """Return whether a comment names columns, as numpy's `savetxt` writes it."""
    return any(sum(map(is_known, split_cells(line, separator))) > 1 for separator in SEPARATORS)


def _is_time(header: str) -> bool:
    column = parse_header(header, 0)
    return column is not None and column.quantity is Quantity.TIME


def _content(path: Path) -> bytes:
    try:
        data = read_table_bytes(path, MAX_MB)
    except OSError as error:
        raise unreadable(path, error) from error
    if data.startswith(b"PK"):
        raise ThumperError(f"{path}: a workbook; save the sheet as CSV", exit_code=EXIT_USAGE)
    return data


def _decoded(data: bytes) -> Iterator[str]:
    """Yield the text; of an 8-bit code, in Western and Central European, as the header shows which."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        yield data.decode("utf-16", errors="replace")
    elif data[1:8:2] == bytes(4):
        yield data.decode("utf-16-le", errors="replace")
    else:
        try:
            yield data.decode("utf-8-sig")
        except UnicodeDecodeError:
            yield data.decode("cp1252", errors="replace")
            yield data.decode("cp1250", errors="replace")
