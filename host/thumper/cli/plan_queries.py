"""Many planning questions from a CSV file."""

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.maps.occupancy_grid import OccupancyGrid

METRES = ("start_x", "start_y", "goal_x", "goal_y")
CELLS = ("start_col", "start_row", "goal_col", "goal_row")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanQuery:
    """From where to where [m]."""

    start_m: tuple[float, float]
    goal_m: tuple[float, float]


def read_queries(path: Path, grid: OccupancyGrid) -> list[PlanQuery]:
    """Read start and goal of each row.

    The header names the columns start_x, start_y, goal_x, goal_y [m] (a suffix `_m` is allowed), or
    start_col, start_row, goal_col, goal_row [cells, rows counted from the map's bottom; a suffix
    `_from_bottom` is allowed]; other columns are ignored. Without a header the first four columns are metres.

    Raises
    ------
    ThumperError
        The file cannot be read, a column is missing, or a value is no finite number; the message names the
        line.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = [
                (number, row) for number, row in enumerate(csv.reader(stream), 1) if any(map(str.strip, row))
            ]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ThumperError(
            f"{path}: cannot be read as CSV ({error}); check the file", exit_code=EXIT_USAGE
        ) from error
    if not rows:
        raise ThumperError(f"{path}: holds no rows; give one start and goal a line", exit_code=EXIT_USAGE)
    columns, in_cells = _columns(path, rows[0][1])
    queries = []
    for number, row in rows if columns is None else rows[1:]:
        values = [_number(path, number, row, index) for index in columns or range(4)]
        if in_cells:
            values = [
                value for i in (0, 2) for value in grid.centre_of(round(values[i + 1]), round(values[i]))
            ]
        queries.append(PlanQuery(start_m=(values[0], values[1]), goal_m=(values[2], values[3])))
    if not queries:
        raise ThumperError(
            f"{path}: holds a header and no rows; give one start and goal a line", exit_code=EXIT_USAGE
        )
    return queries


def _columns(path: Path, header: Sequence[str]) -> tuple[list[int] | None, bool]:
    """Where the four numbers are and whether they are cells; None when the first row is already data."""
    names = [name.strip().lower().removesuffix("_m").removesuffix("_from_bottom") for name in header]
    for wanted in (METRES, CELLS):
        if all(name in names for name in wanted):
            return [names.index(name) for name in wanted], wanted is CELLS
    if all(_is_number(name) for name in names[:4]):
        return None, False
    raise ThumperError(
        f"{path}: line 1: needs the columns {', '.join(METRES)} (or {', '.join(CELLS)}), "
        f"has {', '.join(names)}; rename them",
        exit_code=EXIT_USAGE,
    )


def _number(path: Path, line: int, row: Sequence[str], index: int) -> float:
    text = row[index].strip() if index < len(row) else ""
    if not _is_number(text):
        raise ThumperError(
            f"{path}: line {line}: '{text}' is not a number; mend column {index + 1}", exit_code=EXIT_USAGE
        )
    return float(text)


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
