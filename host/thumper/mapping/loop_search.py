"""Closing loops: where the newest places lie on the map of old ones, and whether that is sure."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.geometry import FloatArray, Pose2, wrap_angle
from thumper.mapping.cells import Cells
from thumper.mapping.grid_mapper import GridMapperOptions
from thumper.mapping.place_graph import PlaceGraph
from thumper.mapping.scan_match import match, score
from thumper.mapping.scan_points import HIT
from thumper.mapping.wide_search import SearchField

RECENT_PLACES = 3  # their scans together are matched: one scan of a corridor looks like every other
OLD_PLACES = 4  # places before and after the candidate that make the old map
MATCHED_BEAMS = 500
AGREE_M, AGREE_RAD = 0.3, 0.05  # two closures in a row must say the same
SEARCH_STD_M = 0.15
FIRST_WINDOW_M, FIRST_WINDOW_RAD = 0.5, 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A closure that waits for a second one that agrees."""

    old: int
    new: int
    old_from_new: Pose2
    shift: Pose2  # what it would do to the map at the new place


class LoopSearch:
    """Finds loops at each new place and adds those that are sure to the graph."""

    def __init__(
        self,
        options: GridMapperOptions,
        places: PlaceGraph,
        drift_per_m: float,
        drift_rad_per_m: float,
        largest_window_m: float,
        accept_score: float,
        rival_ratio: float,
    ) -> None:
        self._options = options
        self._places = places
        self._drift_per_m, self._drift_rad_per_m = drift_per_m, drift_rad_per_m
        self._largest_window_m = largest_window_m
        self._accept_score, self._rival_ratio = accept_score, rival_ratio
        self._waiting: Candidate | None = None
        self.refused = 0

    def look(self, near: dict[int, float]) -> bool:
        """Whether a loop was closed between the place just finished and one that is not in `near`."""
        places, new = self._places, self._places.newest - 1
        if new < RECENT_PLACES:
            return False
        here = places.pose(new)
        far = [p for p in range(new) if p not in near]
        # The way driven since bounds the drift from above, whatever loops were closed in between.
        reachable = [
            (places.pose(p).distance_m(here), p)
            for p in far
            if places.pose(p).distance_m(here) < self._window_m(places.way_m(p, new)) + 1.0
        ]
        if not reachable:
            self._waiting = None
            return False
        old = min(reachable)[1]
        found = self._match(old, new)
        if found is None:
            return False
        waiting, self._waiting = self._waiting, found
        if waiting is None or waiting.new < new - 2 or not _agree(waiting.shift @ here, found.shift @ here):
            return False
        for closure in (waiting, found):
            places.connect(closure.old, closure.new, closure.old_from_new, loop=True)
        self._waiting = None
        return True

    def warm_up(self) -> None:
        """Compile the kernels on a map that is thrown away."""
        field = SearchField(np.full((8, 8), 0.5, dtype=np.float32), 0.05, (0.0, 0.0), SEARCH_STD_M)
        field.search(np.zeros((4, 2)), Pose2(), 0.1, 0.05)

    def _window_m(self, way_m: float) -> float:
        return min(self._largest_window_m, FIRST_WINDOW_M + self._drift_per_m * way_m)

    def _match(self, old: int, new: int) -> Candidate | None:
        """Lay the newest places on the old map; None when that explains too little or is ambiguous."""
        places, options = self._places, self._options
        cells = Cells(options.resolution_m, options.reach_m, options.occupied_fraction)
        places.enter(cells, 0, set(range(max(0, old - OLD_PLACES), min(new, old + OLD_PLACES + 1))))
        points_m = self._recent_hits(new)
        way_m = places.way_m(old, new)
        centre = places.pose(new)
        turn_rad = min(math.pi / 3.0, FIRST_WINDOW_RAD + self._drift_rad_per_m * way_m)
        thin = points_m[:: max(1, len(points_m) // 200)]
        found = SearchField.of(cells, SEARCH_STD_M).search(thin, centre, self._window_m(way_m), turn_rad)
        pose, value = self._refined(cells, points_m, found.pose)
        if value < self._accept_score or found.rival > self._rival_ratio * found.score:
            self.refused += 1
            return None
        return Candidate(
            old=old,
            new=new,
            old_from_new=places.pose(old).inverse() @ pose,
            shift=pose @ centre.inverse(),
        )

    def _recent_hits(self, new: int) -> FloatArray:
        """Hits of the newest places in the frame of place `new`, shape (n, 2)."""
        places = self._places
        new_from_map = places.pose(new).inverse()
        parts = [
            (new_from_map @ places.pose(scan.place) @ scan.place_from_base).apply(
                scan.ends_m[scan.kinds == HIT].astype(np.float64)
            )
            for scan in places.scans[-20 * RECENT_PLACES * 3 :]
            if scan is not None and new - RECENT_PLACES < scan.place <= new
        ]
        points_m = np.concatenate(parts)
        return np.ascontiguousarray(points_m[:: max(1, len(points_m) // MATCHED_BEAMS)])

    def _refined(self, cells: Cells, points_m: FloatArray, start: Pose2) -> tuple[Pose2, float]:
        matching, (x_m, y_m) = self._options.matching, cells.corner_m
        at = np.array([start.x_m - x_m, start.y_m - y_m, start.theta_rad])
        found = match(
            points_m, at, at, np.eye(3), cells.distance_m, cells.resolution_m, cells.reach_m,
            matching.beam_std_m, matching.outlier_m, matching.iterations,
        )  # fmt: skip
        value = score(
            points_m, found, cells.distance_m, cells.resolution_m, cells.reach_m, self._options.score_std_m
        )
        x, y, theta = (float(part) for part in found)
        return Pose2(x_m=x + x_m, y_m=y + y_m, theta_rad=wrap_angle(theta)), value


def _agree(one: Pose2, two: Pose2) -> bool:
    """Whether two closures put the same place at the same pose, within the noise."""
    apart = one.inverse() @ two
    return math.hypot(apart.x_m, apart.y_m) < AGREE_M and abs(apart.theta_rad) < AGREE_RAD
