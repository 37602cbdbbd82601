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
from thumper.slam.pose_graph.loop_hypotheses import Closure, LoopHypotheses
from thumper.slam.pose_graph.map_rebuild import MapRebuild
from thumper.slam.pose_graph.submaps import SubmapGraph

RECENT_SUBMAPS = 3  # matched together: one scan of a corridor looks like every other
OLD_SUBMAPS = 4  # submaps before and after the candidate that make the old map
MATCHED_BEAMS = 500
SEARCHED_BEAMS = 200
MAX_PLACES = 3  # old places that are searched in turn, if several are within reach
LOOKUPS_PER_PART = 5_000_000  # cell look-ups in one part of the search: 1 to 2 ms
MAP_RANGE_M = 30.0  # beams of the old map, up to here: a closure compares near walls
SEARCH_STD_M = 0.15
SEARCH_CELL_M = 0.1  # of the map that is searched
MIN_WINDOW_M, MIN_WINDOW_RAD = 0.5, 0.1
MAX_WINDOW_RAD = math.pi / 3.0
DRIFT_RAD_PER_M = 0.003  # growth of the window's angle per metre of loop
SHIFT_MARGIN_M = 2.0  # of the window around a place that was found before
REACHABLE_MARGIN_M = 1.0  # an old submap this far outside the window may still overlap it


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopOptions:
    """Options of loop closure. Those of `GridMapperOptions` apply to the front end."""

    active_m: Annotated[float, Gt(0)] = 120.0  # distance along the graph up to which submaps are matched
    drift_per_m: Annotated[float, Gt(0)] = 0.03  # growth of the search window per metre of loop
    largest_window_m: Annotated[float, Gt(0)] = 12.0  # limit of the window's half side
    accept_score: Annotated[float, Interval(gt=0, le=1)] = 0.6  # share of beams a closure must explain


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
        self._searched: set[int] = set()
        self._hypotheses = LoopHypotheses()
        self._turn = 0  # which of the places within reach is searched next

    @property
    def busy(self) -> bool:
        """Whether a search is in progress."""
        return self._current is not None

    def start(self, near: dict[int, float]) -> None:
        """Start a search for a loop between the submap just finished and one that is not in `near`.

        A search may take longer than the robot takes through a submap: the ones in between are left out.
        """
        new = self._submap_to_search()
        if new < RECENT_SUBMAPS or new in self._searched:
            return
        self._searched.add(new)
        places = self._places(new, set(range(new)) - near.keys())
        if not places:
            self._hypotheses.miss()
            return
        old, options = places[self._turn % len(places)], self._options
        self._current = LoopCandidateSearch(
            old=old,
            new=new,
            old_map=MapRebuild(
                hit_grid=HitGrid(
                    options.resolution_m, options.reach_m, options.occupied_fraction, distances="deferred"
                ),
                chosen=set(range(max(0, old - OLD_SUBMAPS), min(new, old + OLD_SUBMAPS + 1))),
                range_m=MAP_RANGE_M,
            ),
        )

    def _submap_to_search(self) -> int:
        """Return the submap just finished, or one that was left out near a place that the drive has left."""
        newest, best = self._submaps.newest - 1, self._hypotheses.best
        if best is not None and best.misses:
            found = [closure.new for closure in best.closures]
            for left_out in (max(found) + RECENT_SUBMAPS, min(found) - RECENT_SUBMAPS):
                if RECENT_SUBMAPS <= left_out < newest and left_out not in self._searched:
                    return left_out
        return newest

    def _places(self, new: int, old: set[int]) -> list[int]:
        """Return the old submaps to search for the new one: the nearest of each stretch of the drive.

        If a place was found before, it is the only one.
        """
        submaps, hypothesis = self._submaps, self._hypotheses.best
        reachable = sorted(self._reachable(new, old))
        if hypothesis is not None and reachable:
            here = hypothesis.shift @ submaps.pose(new)
            return [
                min((each for _, each in reachable), key=lambda each: submaps.pose(each).distance_m(here))
            ]
        places: list[int] = []
        for _, submap in reachable:
            if all(abs(submap - place) > 2 * OLD_SUBMAPS for place in places):
                places.append(submap)
        return places[:MAX_PLACES]

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
        for hypothesis in self._hypotheses.all:  # what was found before must not leave the window
            shifted_m = (hypothesis.shift @ centre).distance_m(centre) + SHIFT_MARGIN_M
            window_m = max(window_m, min(shifted_m, self._loops.largest_window_m))
        return BranchAndBoundSearch(field, thinned, centre, window_m, window_rad)

    def _window_m(self, path_length_m: FloatArray) -> FloatArray:
        growth_m: FloatArray = MIN_WINDOW_M + self._loops.drift_per_m * path_length_m
        return np.minimum(self._loops.largest_window_m, growth_m)

    def _check(self, current: LoopCandidateSearch, found: SearchResult) -> Closure | None:
        """Return the closure; None if it explains too little."""
        submaps, points_m = self._submaps, self._recent_hits(current.new)
        match = GridMatcher(current.old_map.hit_grid, self._options).refine(points_m, found.pose, np.eye(3))
        if match.score < self._loops.accept_score:
            return None
        return Closure(
            old=current.old,
            new=current.new,
            old_from_new=submaps.pose(current.old).inverse() @ match.pose,
            shift=match.pose @ submaps.pose(current.new).inverse(),
            lead=found.score - found.runner_up,
        )

    def accept(self, new: int, found: Closure | None) -> bool:
        """Add the closures that agree once they lead clearly; return whether they were added.

        `found` is the closure of submap `new`, if there is one. Where a corridor repeats itself, a wrong pose
        may lead a little, submap after submap.
        """
        submaps, hypotheses = self._submaps, self._hypotheses
        clearest = [each.clearest.new for each in hypotheses.all]
        way_m = {each: submaps.path_length_m(each, new) for each in clearest}
        accepted = hypotheses.add(found, submaps.pose(new), way_m)
        self._turn = 0 if hypotheses.all else self._turn + 1
        for closure in accepted:
            submaps.connect(closure.old, closure.new, closure.old_from_new, loop=True)
        return bool(accepted)

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
    """Return the field of every second cell or so: finer than the likelihood is wide."""
    step = max(1, round(SEARCH_CELL_M / grid.resolution_m))
    distance_m, cell_m = grid.distances_m(step), step * grid.resolution_m
    x_m, y_m = grid.corner_m
    shift_m = 0.5 * (cell_m - grid.resolution_m)  # a large cell takes the distance of its first small one
    return SearchField.search(
        distance_m, grid.max_distance_m, cell_m, (x_m - shift_m, y_m - shift_m), SEARCH_STD_M
    )
