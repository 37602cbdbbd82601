"""Closing loops: where the newest places lie on the map of old ones, and whether that is sure."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, wrap_angle
from thumper.lidar.deskew import HIT
from thumper.slam.grid.branch_and_bound import BranchAndBoundSearch, SearchField, SearchResult
from thumper.slam.grid.grid_mapper import GridMapperOptions
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.pose_graph.map_rebuild import MapRebuild
from thumper.slam.pose_graph.submaps import SubmapGraph
from thumper.slam.scan_matching.gauss_newton import match, score

RECENT_PLACES = 3  # their scans together are matched: one scan of a corridor looks like every other
OLD_PLACES = 4  # places before and after the candidate that make the old map
MATCHED_BEAMS = 500
AGREE_M, AGREE_RAD = 0.3, 0.05  # the closures of two places in a row must say the same
SCANS_AT_ONCE = 6  # of the old map, entered in one part of the search: some ms
LOOKED_UP_AT_ONCE = 20_000_000  # cells looked up in one part: some ms
SEARCH_STD_M = 0.15
FIRST_WINDOW_M, FIRST_WINDOW_RAD = 0.5, 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A closure that waits for that of the next place, which must agree."""

    old: int
    new: int
    old_from_new: Pose2
    shift: Pose2  # what it would do to the map at the new place


@dataclass(slots=True, kw_only=True)
class LoopCandidateSearch:
    """A search under way: the map round the old place is drawn, then the newest places are laid on it."""

    old: int
    new: int
    old_map: MapRebuild
    search: BranchAndBoundSearch | None = None


class LoopSearch:
    """Finds loops between new places and old ones and adds those that are sure to the graph, bit by bit."""

    def __init__(
        self,
        options: GridMapperOptions,
        places: SubmapGraph,
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
        self._hunt: LoopCandidateSearch | None = None
        self._searched = -1  # the newest place that was looked for
        self._waiting: Candidate | None = None
        self.refused = 0

    @property
    def busy(self) -> bool:
        """Whether a search is under way."""
        return self._hunt is not None

    def begin(self, near: dict[int, float]) -> None:
        """Begin to look for a loop between the place just finished and one that is not in `near`.

        A search may take longer than the robot through a place. While a closure waits, the place after its
        own is looked for, not the one just finished.
        """
        places, waiting = self._places, self._waiting
        new = places.newest - 1 if waiting is None else waiting.new + 1
        if new < RECENT_PLACES or new <= self._searched:
            return
        self._searched = new
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
            return
        old, options = min(reachable)[1], self._options
        self._hunt = LoopCandidateSearch(
            old=old,
            new=new,
            old_map=MapRebuild(
                cells=HitGrid(options.resolution_m, options.reach_m, options.occupied_fraction),
                chosen=set(range(max(0, old - OLD_PLACES), min(new, old + OLD_PLACES + 1))),
            ),
        )

    def work(self) -> bool:
        """Do a part of the search under way; whether that closed a loop."""
        hunt, places = self._hunt, self._places
        if hunt is None:
            return False
        if hunt.search is None:
            if hunt.old_map.draw(places, SCANS_AT_ONCE):
                points_m = self._recent_hits(hunt.new)
                thin = points_m[:: max(1, len(points_m) // 200)]
                way_m = places.way_m(hunt.old, hunt.new)
                turn_rad = min(math.pi / 3.0, FIRST_WINDOW_RAD + self._drift_rad_per_m * way_m)
                field = SearchField.of(hunt.old_map.cells, SEARCH_STD_M)
                hunt.search = BranchAndBoundSearch(
                    field, thin, places.pose(hunt.new), self._window_m(way_m), turn_rad
                )
            return False
        if not hunt.search.work(LOOKED_UP_AT_ONCE):
            return False
        self._hunt = None
        found = self._judged(hunt, hunt.search.found())
        waiting, self._waiting = self._waiting, found
        here = places.pose(hunt.new)
        if found is None or waiting is None or not _agree(waiting.shift @ here, found.shift @ here):
            return False
        for closure in (waiting, found):
            places.connect(closure.old, closure.new, closure.old_from_new, loop=True)
        self._waiting = None
        return True

    def warm_up(self) -> None:
        """Compile the kernels on a map that is thrown away."""
        field = SearchField(np.full((8, 8), 0.5, dtype=np.float32), 0.05, (0.0, 0.0), SEARCH_STD_M)
        BranchAndBoundSearch(field, np.zeros((4, 2)), Pose2(), 0.1, 0.05).work(None)

    def _window_m(self, way_m: float) -> float:
        return min(self._largest_window_m, FIRST_WINDOW_M + self._drift_per_m * way_m)

    def _judged(self, hunt: LoopCandidateSearch, found: SearchResult) -> Candidate | None:
        """The closure; None where it explains too little or is ambiguous."""
        places, points_m = self._places, self._recent_hits(hunt.new)
        pose, value = self._refined(hunt.old_map.cells, points_m, found.pose)
        if value < self._accept_score or found.rival > self._rival_ratio * found.score:
            self.refused += 1
            return None
        return Candidate(
            old=hunt.old,
            new=hunt.new,
            old_from_new=places.pose(hunt.old).inverse() @ pose,
            shift=pose @ places.pose(hunt.new).inverse(),
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

    def _refined(self, cells: HitGrid, points_m: FloatArray, start: Pose2) -> tuple[Pose2, float]:
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
