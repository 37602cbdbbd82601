"""Which of several places the drive came back to."""

import numpy as np

from thumper.common.geometry import Pose2
from thumper.lidar.deskew import HIT, ScanPoints
from thumper.slam.grid.options import GridMapperOptions
from thumper.slam.pose_graph.loop_closure import LoopOptions, LoopSearch
from thumper.slam.pose_graph.loop_hypotheses import Closure, LoopHypotheses
from thumper.slam.pose_graph.submaps import SubmapGraph


def closure(new: int, lead: float, x_m: float, old: int = 0) -> Closure:
    return Closure(old=old, new=new, old_from_new=Pose2(), shift=Pose2(x_m=x_m), lead=lead)


def accepted(closures: list[Closure | None]) -> list[Closure]:
    """Return what is accepted of the results of one search per 10 m."""
    hypotheses, found = LoopHypotheses(), list[Closure]()
    for number, each in enumerate(closures):
        here = Pose2(x_m=10.0 * number)
        way_m = {number: 10.0 * (len(closures) - number) for number in range(len(closures))}
        found += hypotheses.add(each, here, way_m)
    return found


def test_ambiguous_and_failed_searches_do_not_drop_a_place() -> None:
    """A corridor: doorways look alike every few metres, and one submap shows none."""
    clear = [closure(0, 0.15, 5.0), closure(2, 0.12, 5.1), closure(4, 0.1, 5.0)]
    results = [clear[0], None, clear[1], closure(3, 0.02, 5.4), clear[2]]
    assert accepted(results) == clear  # without the ambiguous one, which may be off along the corridor


def test_the_other_place_counts_against_the_one_that_leads() -> None:
    """Two places by turns: neither of them is proven."""
    results = [closure(n, 0.15, 5.0 if n % 2 else -5.0) for n in range(5)]
    assert accepted(list(results)) == []


def test_one_clear_closure_is_not_enough() -> None:
    assert accepted([closure(0, 0.35, 5.0), closure(1, 0.0, 5.0)]) == []
    clear = [closure(0, 0.35, 5.0), closure(2, 0.1, 5.0)]
    assert accepted([clear[0], closure(1, 0.0, 5.0), clear[1]]) == clear  # the place is kept until then


def test_a_place_without_support_is_dropped() -> None:
    results = [closure(0, 0.25, 5.0), None, None, None, closure(4, 0.1, 5.0)]
    assert accepted(list(results)) == []


def three_passes() -> SubmapGraph:
    """Return the submaps of a corridor of 60 m: there, back and there again."""
    submaps = SubmapGraph()
    point = ScanPoints(origins_m=np.zeros((1, 2)), ends_m=np.ones((1, 2)), kinds=np.full(1, HIT, np.uint8))
    there = [Pose2(x_m=0.5 * step) for step in range(120)]
    for pose in (*there, *reversed(there), *there[:60]):
        submaps.add(pose, point)
    return submaps


def test_places_within_reach_are_searched_in_turn() -> None:
    """Only the nearest was searched, submap after submap, even if another round of the drive lay there."""
    submaps = three_passes()
    new = submaps.newest - 1
    search = LoopSearch(GridMapperOptions(), LoopOptions(), submaps)
    near = dict.fromkeys(range(new - 20, new + 2), 0.0)
    old = list[int]()
    for _ in range(3):
        search._searched.clear()
        search.start(near)
        assert search._current
        old.append(search._current.old)
        search.accept(new, None)
    assert old[0] == old[2] != old[1]
    for submap in old:
        assert submaps.pose(submap).distance_m(submaps.pose(new)) < 2.0
    assert search.accept(new, closure(new, 0.2, 0.0, old[1])) is False
    search._searched.clear()
    search.start(near)  # from now on the place that was found
    assert search._current
    assert search._current.old in old


def test_search_does_not_fall_behind_the_drive() -> None:
    """While a closure waited for agreement, the next submap was searched, 17 behind the robot at worst."""
    submaps = three_passes()
    search = LoopSearch(GridMapperOptions(), LoopOptions(), submaps)
    search.accept(submaps.newest - 20, closure(submaps.newest - 20, 0.2, 0.0))
    search.start({})
    assert search._current
    assert search._current.new == submaps.newest - 1
