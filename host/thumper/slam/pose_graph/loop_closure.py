"""Loop closure: find the newest submaps on the map of old ones, and accept only unambiguous matches."""

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.resumable import Search, SlicedSearch
from thumper.lidar.deskew import HIT
from thumper.slam.grid.branch_and_bound import BranchAndBoundSearch, SearchField, SearchResult
from thumper.slam.grid.grid_matcher import GridMatcher
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.grid.options import GridMapperOptions
from thumper.slam.pose_graph.map_rebuild import MapRebuild
from thumper.slam.pose_graph.submaps import SubmapGraph

RECENT_SUBMAPS = 3  # matched together: one scan of a corridor looks like every other
OLD_SUBMAPS = 4  # submaps before and after the candidate that make the old map
MATCHED_BEAMS = 500
SEARCHED_BEAMS = 200
AGREE_M, AGREE_RAD = 0.3, 0.05  # the closures of two consecutive submaps must agree this closely
LEAD = 0.3  # sum of the leads, over all other poses of the window, of closures that agree
LOOKUPS_PER_PART = 3_000_000  # cell look-ups in one part of the search: 1 to 2 ms
MAP_RANGE_M = 30.0  # beams of the old map, up to here: a closure compares near walls
SEARCH_STD_M = 0.15
MIN_WINDOW_M, MIN_WINDOW_RAD = 0.5, 0.1
MAX_WINDOW_RAD = math.pi / 3.0
DRIFT_RAD_PER_M = 0.003  # growth of the window's angle per metre of loop
RUNNER_UP_RATIO = 0.9  # a closure is ambiguous if another pose explains this share of it
REACHABLE_MARGIN_M = 1.0  # an old submap this far outside the window may still overlap it


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopOptions:
    """Options of loop closure. Those of `GridMapperOptions` apply to the front end."""

    active_m: Annotated[float, Gt(0)] = 120.0  # distance along the graph up to which submaps are matched
    drift_per_m: Annotated[float, Gt(0)] = 0.03  # growth of the search window per metre of loop
    largest_window_m: Annotated[float, Gt(0)] = 12.0  # limit of the window's half side
    accept_score: Annotated[float, Interval(gt=0, le=1)] = 0.6  # share of beams a closure must explain


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A closure that waits for those of the next submaps, which must agree."""

    old: int
    new: int
    old_from_new: Pose2
    shift: Pose2  # motion of the map at the new submap if the closure is accepted
    lead: float  # share of the beams that it explains beyond any other pose of the window


@dataclass(slots=True, kw_only=True)
class LoopCandidateSearch:
    """A search in progress: first the map around the old submap is rebuilt, then the new one is matched."""

    old: int
    new: int
    old_map: MapRebuild
    preparation: SlicedSearch[SearchField] = field(default_factory=SlicedSearch)
    search: BranchAndBoundSearch | None = None


class LoopSearch:
    """Finds loops between new and old submaps, in parts, and adds accepted ones to the graph."""

    def __init__(self, options: GridMapperOptions, loops: LoopOptions, submaps: SubmapGraph) -> None:
        self._options, self._loops, self._submaps = options, loops, submaps
        self._current: LoopCandidateSearch | None = None
        self._newest_searched = -1
        self._waiting: list[Candidate] = []
        self.rejected = 0

    @property
    def busy(self) -> bool:
        """Whether a search is in progress."""
        return self._current is not None

    def start(self, near: dict[int, float]) -> None:
        """Start a search for a loop between the submap just finished and one that is not in `near`.

        A search may take longer than the robot takes through a submap. While a closure waits for agreement,
        the submap after its own is searched for, not the one just finished.
        """
        submaps, waiting = self._submaps, self._waiting
        new = waiting[-1].new + 1 if waiting else submaps.newest - 1
        if new < RECENT_SUBMAPS or new <= self._newest_searched:
            return
        self._newest_searched = new
        reachable = self._reachable(new, set(range(new)) - near.keys())
        if not reachable:
            self._waiting = []
            return
        old, options = min(reachable)[1], self._options
        self._current = LoopCandidateSearch(
            old=old,
            new=new,
            old_map=MapRebuild(
                hit_grid=HitGrid(options.resolution_m, options.reach_m, options.occupied_fraction),
                chosen=set(range(max(0, old - OLD_SUBMAPS), min(new, old + OLD_SUBMAPS + 1))),
                range_m=MAP_RANGE_M,
            ),
        )

    def _reachable(self, new: int, old: set[int]) -> list[tuple[float, int]]:
        """Return which of the old submaps may be where the new one is, with their distances [m].

        The distance driven since bounds the drift, whatever loops were closed in between.
        """
        submaps, chosen = self._submaps, np.array(sorted(old), dtype=np.int64)
        driven_m = submaps.path_lengths_m(chosen, new)
        x_m, y_m = (submaps.poses[chosen, :2] - submaps.poses[new, :2]).T
        distance_m = np.hypot(x_m, y_m)
        found = distance_m < self._window_m(driven_m) + REACHABLE_MARGIN_M
        return list(zip(distance_m[found].tolist(), chosen[found].tolist(), strict=True))

    def run_part(self) -> bool:
        """Run one part of the search in progress and return whether it closed a loop."""
        current = self._current
        if current is None:
            return False
        if current.search is None:
            if current.preparation.is_running:
                if (searched := current.preparation.advance()) is not None:
                    current.search = self._branch_and_bound(current, searched)
            elif current.old_map.insert_part(self._submaps):
                current.preparation.start(_search_field(current.old_map.hit_grid))
            return False
        if not current.search.run(LOOKUPS_PER_PART):
            return False
        self._current = None
        return self.accept(current.new, self._check(current, current.search.result()))

    def warm_up(self) -> None:
        """Compile the kernels, or load them from the cache, on a scratch map."""
        field = SearchField(np.full((8, 8), 0.5, dtype=np.float32), 0.05, (0.0, 0.0), SEARCH_STD_M)
        BranchAndBoundSearch(field, np.zeros((4, 2)), Pose2(), 0.1, 0.05).run(None)

    def _branch_and_bound(self, current: LoopCandidateSearch, field: SearchField) -> BranchAndBoundSearch:
        points_m = self._recent_hits(current.new)
        thinned = points_m[:: max(1, len(points_m) // SEARCHED_BEAMS)]
        length_m = self._submaps.path_length_m(current.old, current.new)
        window_m = float(self._window_m(np.array(length_m)))
        window_rad = min(MAX_WINDOW_RAD, MIN_WINDOW_RAD + DRIFT_RAD_PER_M * length_m)
        centre = self._submaps.pose(current.new)
        return BranchAndBoundSearch(field, thinned, centre, window_m, window_rad)

    def _window_m(self, path_length_m: FloatArray) -> FloatArray:
        growth_m: FloatArray = MIN_WINDOW_M + self._loops.drift_per_m * path_length_m
        return np.minimum(self._loops.largest_window_m, growth_m)

    def _check(self, current: LoopCandidateSearch, found: SearchResult) -> Candidate | None:
        """Return the closure; None if it explains too little or is ambiguous."""
        submaps, points_m = self._submaps, self._recent_hits(current.new)
        match = GridMatcher(current.old_map.hit_grid, self._options).refine(points_m, found.pose, np.eye(3))
        ambiguous = found.runner_up > RUNNER_UP_RATIO * found.score
        if match.score < self._loops.accept_score or ambiguous:
            self.rejected += 1
            return None
        return Candidate(
            old=current.old,
            new=current.new,
            old_from_new=submaps.pose(current.old).inverse() @ match.pose,
            shift=match.pose @ submaps.pose(current.new).inverse(),
            lead=found.score - found.runner_up,
        )

    def accept(self, new: int, found: Candidate | None) -> bool:
        """Add the closures that agree once they lead clearly; return whether they were added.

        `found` is the closure of submap `new`, if there is one. Where a corridor repeats itself, a wrong pose
        may lead a little, submap after submap.
        """
        here = self._submaps.pose(new)
        if found is None:
            self._waiting = []
            return False
        agree = self._waiting and _agree(self._waiting[-1].shift @ here, found.shift @ here)
        self._waiting = [*(self._waiting if agree else []), found]
        if len(self._waiting) < 2 or sum(each.lead for each in self._waiting) < LEAD:
            return False
        for closure in self._waiting:
            self._submaps.connect(closure.old, closure.new, closure.old_from_new, loop=True)
        self._waiting = []
        return True

    def _recent_hits(self, new: int) -> FloatArray:
        """Return the hits of the newest submaps in the frame of submap `new`, shape (n, 2)."""
        submaps = self._submaps
        new_from_map = submaps.pose(new).inverse()
        parts = [
            (new_from_map @ submaps.pose(scan.submap) @ scan.submap_from_base).apply(
                scan.ends_m[scan.kinds == HIT].astype(np.float64)
            )
            for scan in submaps.scans_of(new - RECENT_SUBMAPS + 1, new)
        ]
        points_m = np.concatenate(parts)
        return np.ascontiguousarray(points_m[:: max(1, len(points_m) // MATCHED_BEAMS)])


def _search_field(grid: HitGrid) -> Search[SearchField]:
    return SearchField.search(
        grid.distance_m, grid.max_distance_m, grid.resolution_m, grid.corner_m, SEARCH_STD_M
    )


def _agree(first: Pose2, second: Pose2) -> bool:
    """Return whether two closures put the same submap at the same pose, within the noise."""
    apart = first.inverse() @ second
    return math.hypot(apart.x_m, apart.y_m) < AGREE_M and abs(apart.theta_rad) < AGREE_RAD
