"""Path planning queries: read them from a CSV file, answer them on a saved map."""

import csv
import io
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import read_bytes
from thumper.common.geometry import FloatArray, Pose2
from thumper.common.texts import shortened
from thumper.config.robot import RobotConfig
from thumper.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from thumper.navigation.controllers.speed_limiter import SpeedLimiter
from thumper.navigation.costmap.costmap import build_costmap
from thumper.navigation.costmap.filters import CostmapFilters, load_masks
from thumper.navigation.costmap.footprint_collision import ground_cost_at
from thumper.navigation.goal import Goal, check_place
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.polyline import arc_lengths, resample
from thumper.navigation.registry import make_planner

METRES = ("start_x", "start_y", "goal_x", "goal_y")
CELLS = ("start_col", "start_row", "goal_col", "goal_row")
CSV_COLUMNS = (*METRES, "found", "length_m", "time_ms", "reason")
DECIMALS = 4
MAX_MB = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanQuery:
    """Start and goal position [m]."""

    start_m: tuple[float, float]
    goal_m: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanAnswer:
    """The path of a query, or the reason why there is none."""

    query: PlanQuery
    path_m: FloatArray | None  # shape (n, 2)
    reason: str
    time_ms: float  # of planning
    travel_s: float | None  # at the fastest allowed speed
    unknown_m: float | None  # length through unknown space
    start_category: str
    goal_category: str

    @property
    def found(self) -> bool:
        """Return whether there is a path."""
        return self.path_m is not None

    @property
    def length_m(self) -> float | None:
        """Return the length of the path."""
        return None if self.path_m is None else round(float(arc_lengths(self.path_m)[-1]), DECIMALS)

    def to_json(self) -> dict[str, object]:
        """Return all but the path as a JSON object."""
        return {
            "start": [round(number, DECIMALS) for number in self.query.start_m],
            "goal": [round(number, DECIMALS) for number in self.query.goal_m],
            "found": self.found,
            "length_m": self.length_m,
            "time_ms": round(self.time_ms, 3),
            "reason": self.reason,
            "travel_s": None if self.travel_s is None else round(self.travel_s, DECIMALS),
            "unknown_m": None if self.unknown_m is None else round(self.unknown_m, DECIMALS),
            "start_category": self.start_category,
            "goal_category": self.goal_category,
        }


class QueryPlanner:
    """Plans on one saved map with the robot's planner, costmap and speed limits."""

    def __init__(
        self, grid: OccupancyGrid, settings: RobotConfig, options: NavigationOptions, zones: CostmapFilters
    ) -> None:
        """`zones` are the masks of the zones that were saved with the map."""
        masks = load_masks(options.masks) + zones
        self._grid = grid
        self.keepout = masks.keepout
        self._footprint = settings.footprint
        self._planner = make_planner(options, settings.footprint)
        self._limiter = SpeedLimiter(options.limits, approach_m_s=options.approach_m_s, masks=masks.speed)
        self._costmap = build_costmap(
            grid, np.empty((0, 2)), settings.footprint, options.costmap, masks.keepout
        )

    def answer(self, query: PlanQuery, *, tolerance_m: float, heading_deg: float) -> PlanAnswer:
        """Plan from start to goal.

        Raises
        ------
        ThumperError
            A number is not finite or beyond any map.
        """
        if not all(map(math.isfinite, (*query.start_m, *query.goal_m, heading_deg, tolerance_m))):
            raise ThumperError(
                "start, goal, heading and tolerance must be finite numbers", exit_code=EXIT_USAGE
            )
        check_place("the start", *query.start_m)
        check_place("the goal", *query.goal_m)
        start = Pose2(x_m=query.start_m[0], y_m=query.start_m[1], theta_rad=math.radians(heading_deg))
        goal = Goal(x_m=query.goal_m[0], y_m=query.goal_m[1], tolerance_m=tolerance_m)
        begin_s = time.perf_counter()
        result = self._planner.plan(self._costmap, start, goal)
        time_ms = 1e3 * (time.perf_counter() - begin_s)
        path_m = result.path_m
        return PlanAnswer(
            query=query,
            path_m=path_m,
            reason=result.reason,
            time_ms=time_ms,
            travel_s=None if path_m is None else self._limiter.travel_time_s(path_m),
            unknown_m=None if path_m is None else _unknown_m(self._grid, path_m),
            start_category=self._category(*query.start_m),
            goal_category=self._category(*query.goal_m),
        )

    def _category(self, x_m: float, y_m: float) -> str:
        category = ground_cost_at(self._costmap, self._footprint, x_m, y_m)
        return "off the map" if category is None else category.value


def _unknown_m(grid: OccupancyGrid, path_m: FloatArray) -> float:
    """Return the length of a path through cells that are unknown, or outside the map [m]."""
    points_m = resample(path_m, 0.5 * grid.resolution_m)
    is_unknown = grid.values_at(points_m) == UNKNOWN
    return float(is_unknown[1:] @ np.diff(arc_lengths(points_m)))


def to_csv(answers: Sequence[PlanAnswer]) -> str:
    """Return a CSV table with a header and one line per answer."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for answer in answers:
        ends = (round(number, DECIMALS) for number in (*answer.query.start_m, *answer.query.goal_m))
        writer.writerow((*ends, int(answer.found), answer.length_m, round(answer.time_ms, 3), answer.reason))
    return text.getvalue().rstrip("\n")


def read_queries(path: Path, grid: OccupancyGrid) -> list[PlanQuery]:
    """Read start and goal from each row of a CSV file.

    The header names the columns start_x, start_y, goal_x, goal_y [m] (the suffix `_m` is allowed), or
    start_col, start_row, goal_col, goal_row [cells; rows count from the map's bottom; the suffix
    `_from_bottom` is allowed]. Other columns are ignored. Without a header, the first four columns are
    metres.

    Raises
    ------
    ThumperError
        The file cannot be read, a column is missing, or a value is not a finite number; the message names
        the line.
    """
    try:
        text = read_bytes(path, MAX_MB).decode("utf-8-sig")
        rows = [
            (number, row)
            for number, row in enumerate(csv.reader(io.StringIO(text, newline="")), 1)
            if any(map(str.strip, row))
        ]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ThumperError(
            f"{path}: cannot be read as CSV ({error}); check the file", exit_code=EXIT_USAGE
        ) from error
    if not rows:
        raise ThumperError(f"{path}: has no rows; give one start and goal per line", exit_code=EXIT_USAGE)
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
            f"{path}: has a header but no rows; give one start and goal per line", exit_code=EXIT_USAGE
        )
    return queries


def _columns(path: Path, header: Sequence[str]) -> tuple[list[int] | None, bool]:
    """Return the indices of the four columns and whether they are cells; None for a file without header."""
    names = [name.strip().lower().removesuffix("_m").removesuffix("_from_bottom") for name in header]
    for wanted in (METRES, CELLS):
        if all(name in names for name in wanted):
            return [names.index(name) for name in wanted], wanted is CELLS
    if all(_is_number(name) for name in names[:4]):
        return None, False
    raise ThumperError(
        f"{path}: line 1: needs the columns {', '.join(METRES)} (or {', '.join(CELLS)}), "
        f"has {shortened(', '.join(names))}; rename them",
        exit_code=EXIT_USAGE,
    )


def _number(path: Path, line: int, row: Sequence[str], index: int) -> float:
    text = row[index].strip() if index < len(row) else ""
    if not _is_number(text):
        raise ThumperError(
            f"{path}: line {line}: '{shortened(text)}' is not a number; fix column {index + 1}",
            exit_code=EXIT_USAGE,
        )
    return float(text)


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
