"""An exploration: which frontier next, when to drive on, when to give up, and home."""

import math
from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from tests.host.runtime.drive.carry_out import carry_out
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.common.resumable import Search
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.goal import Goal
from thumper.navigation.planners.frontier_exploration import Explorer, Frontier
from thumper.runtime.drive.exploration import LOOK_CYCLES, NEAR_HOME_M, PATIENCE_S, explore
from thumper.runtime.drive.legs import AnyLeg, Leg, Wait
from thumper.runtime.drive_result import DriveResult

HOME = Goal(x_m=0.0, y_m=0.0)
GRID = OccupancyGrid(cells=np.zeros((80, 80), np.int8), resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
SEEN = np.array([[1.0, 1.0], [1.0, 1.05]])  # in GRID, where nothing is unknown
DRIVE_CYCLES = 100


def frontier(x_m: float, border_m: np.ndarray | None = None) -> Frontier:
    """Return a frontier on the x axis; without a border it is never seen."""
    border_m = np.empty((0, 2)) if border_m is None else border_m
    return Frontier(
        x_m=x_m, y_m=0.0, viewpoint_m=(x_m, 0.0), length_m=1.0, path_cost_m=x_m, border_m=border_m
    )


A, B = frontier(1.0), frontier(2.0)


class Frontiers:
    """An explorer with a fixed list of frontiers, each found in the twelfth slice."""

    def __init__(self, *frontiers: Frontier) -> None:
        self._frontiers = list(frontiers)
        self.skipped: list[Frontier] = []

    def search(self, _grid: OccupancyGrid, _map_from_base: Pose2) -> Search[Frontier | None]:
        for _ in range(11):
            yield
        return self._frontiers.pop(0) if self._frontiers else None

    def goal(self, frontier: Frontier) -> Goal:
        return Goal(x_m=frontier.x_m, y_m=frontier.y_m)

    def skip(self, frontier: Frontier) -> None:
        self.skipped.append(frontier)

    def retry(self, frontiers: list[Frontier]) -> None:
        self._frontiers += frontiers


class Drives:
    """Drives 10 s and 1 m per leg; `ends` changes the result of a goal or raises an error."""

    def __init__(self, **ends: DriveResult | ThumperError) -> None:
        self._ends = ends
        self.names: list[str] = []
        self.legs: list[Leg] = []
        self.cycles: list[int] = []  # of each drive
        self.waited: list[int] = []  # cycles of each wait

    def __call__(self, leg: AnyLeg) -> DriveResult:
        if isinstance(leg, Wait):
            end = self._ends.get("wait")
            if end is None:
                self.waited.append(1)
                while not leg.until():
                    self.waited[-1] += 1
                end = replace(result(), time_s=0.0, path_length_m=0.0)
            if isinstance(end, ThumperError):
                raise end
            return end
        assert isinstance(leg, Leg)
        self.names.append(leg.name)
        self.legs.append(leg)
        end = self._ends.get(leg.name.replace(" ", "_"), result())
        if isinstance(end, ThumperError):
            raise end
        self.cycles.append(next((k for k in range(1, DRIVE_CYCLES) if leg.until()), DRIVE_CYCLES))
        return end


def result(
    *, reached: bool = True, interrupted: bool = False, reason: str = "at the goal", failed: bool = False
) -> DriveResult:
    return DriveResult(
        reached=reached,
        interrupted=interrupted,
        reason=reason,
        time_s=10.0,
        path_length_m=1.0,
        pose=Pose2(),
        navigation_failed=failed,
    )


def exploration(
    drives: Drives, *frontiers: Frontier, limit_s: float = 900.0, home: Goal = HOME
) -> tuple[DriveResult, list[str], Frontiers]:
    reports: list[str] = []
    explorer = Frontiers(*frontiers)
    task = explore(
        cast("Explorer", explorer), lambda: (GRID, Pose2()), home, limit_s=limit_s, report=reports.append
    )
    return carry_out(task, drives), reports, explorer


def test_exploration_scans_visits_all_frontiers_and_returns() -> None:
    drives = Drives()
    total, reports, _ = exploration(drives, A, B)
    assert drives.names == ["initial scan", "frontier 1", "frontier 2", "home"]
    assert (total.reached, total.time_s, total.path_length_m) == (True, 40.0, 4.0)
    assert (
        total.reason
        == "explored after 30 s: reached 2 of 2 frontiers, found 16.0 m² of free floor; back at the start"
    )
    assert reports == ["explored after 30 s: reached 2 of 2 frontiers, found 16.0 m² of free floor"]


def test_the_robot_runs_its_cycles_while_it_chooses_a_frontier() -> None:
    """Each cycle does three slices. Three searches: two frontiers, and the answer that none is left."""
    drives = Drives()
    exploration(drives, A, B)
    assert drives.waited == [4, 4, 4]


def test_a_robot_that_fails_while_it_chooses_a_frontier_tries_to_return() -> None:
    drives = Drives(wait=result(reached=False, reason="the board went silent"))
    _, reports, _ = exploration(drives, A)
    assert drives.names == ["initial scan", "home"]
    assert reports == ["ended after 20 s: the board went silent"]


def test_an_unreachable_frontier_is_given_up_and_the_next_one_tried() -> None:
    drives = Drives(frontier_1=result(reached=False, reason="no path", failed=True))
    total, reports, _ = exploration(drives, A, B)
    assert drives.names == ["initial scan", "frontier 1", "frontier 2", "frontier 3", "home"]
    assert drives.legs[1].goal == drives.legs[3].goal  # a second time when no other is left
    assert total.reached
    assert reports == [
        "gave up frontier 1 at (1.00, 0.00): no path",
        "explored after 40 s: reached 2 of 3 frontiers, found 16.0 m² of free floor",
    ]


def test_a_frontier_is_not_tried_a_third_time() -> None:
    no_path = result(reached=False, reason="no path", failed=True)
    drives = Drives(frontier_1=no_path, frontier_2=no_path)
    _, reports, _ = exploration(drives, A)
    assert drives.names == ["initial scan", "frontier 1", "frontier 2", "home"]
    assert reports[-1].endswith("found 16.0 m² of free floor, could not reach (1.00, 0.00)")


@pytest.mark.parametrize(
    ("end", "ending"),
    [
        (result(reached=False, reason="no more scans"), "ended after 20 s: no more scans"),
        (ThumperError("a latched fault"), "ended after 10 s: a latched fault"),
    ],
    ids=["robot fails", "refused"],
)
def test_a_robot_that_fails_ends_exploration_and_tries_to_return(
    end: DriveResult | ThumperError, ending: str
) -> None:
    drives = Drives(frontier_1=end, home=ThumperError("still no scans"))
    total, reports, _ = exploration(drives, A, B)
    assert drives.names == ["initial scan", "frontier 1", "home"]
    assert (total.reached, total.reason) == (False, "still no scans")
    assert reports == [ending]


def test_after_ctrl_c_nothing_is_driven() -> None:
    drives = Drives(frontier_1=result(reached=False, interrupted=True, reason="interrupted"))
    total, reports, _ = exploration(drives, A, B)
    assert drives.names == ["initial scan", "frontier 1"]
    assert (total.interrupted, total.reason, total.time_s) == (True, "interrupted", 20.0)
    assert reports == ["interrupted after 20 s: reached 0 of 1 frontiers, found 16.0 m² of free floor"]


def test_ctrl_c_before_there_is_a_map() -> None:
    reports: list[str] = []
    drives = Drives(initial_scan=result(reached=False, interrupted=True, reason="interrupted"))
    task = explore(cast("Explorer", Frontiers(A)), pytest.fail, HOME, limit_s=900.0, report=reports.append)
    carry_out(task, drives)
    assert reports == ["interrupted after 10 s: reached 0 of 0 frontiers"]


def test_when_time_is_up_the_robot_returns() -> None:
    drives = Drives()
    _, reports, _ = exploration(drives, A, B, limit_s=15.0)
    assert drives.names == ["initial scan", "frontier 1", "home"]
    assert reports == ["time is up after 20 s: reached 1 of 1 frontiers, found 16.0 m² of free floor"]


def test_nothing_to_explore() -> None:
    total, reports, _ = exploration(Drives())
    text = "explored: no frontier is left, the map has 16.0 m² of free floor"
    assert reports == [text] == [total.reason]


def test_the_robot_drives_on_once_a_frontier_has_been_seen() -> None:
    drives = Drives()
    _, reports, explorer = exploration(drives, frontier(1.0, SEEN), B)
    assert drives.names == ["initial scan", "frontier 1", "frontier 2", "home"]
    assert drives.cycles == [DRIVE_CYCLES, LOOK_CYCLES + 12, DRIVE_CYCLES, DRIVE_CYCLES]
    assert len(drives.waited) == 2  # for the first frontier, and for the answer that none is left
    assert explorer.skipped == [B]  # the first may have other parts, which are still unseen
    assert reports == ["explored after 30 s: reached 2 of 2 frontiers, found 16.0 m² of free floor"]


def test_a_drive_goes_on_if_the_next_frontier_is_observed_from_the_same_place() -> None:
    drives = Drives()
    exploration(drives, frontier(1.0, SEEN), frontier(1.1), B)
    assert drives.names == ["initial scan", "frontier 1", "frontier 2", "home"]
    assert drives.cycles[1] == DRIVE_CYCLES
    assert drives.legs[2].goal.x_m == 2.0


def test_a_robot_that_stays_in_one_place_gives_a_frontier_up_but_not_home() -> None:
    drives = Drives()
    _, _, explorer = exploration(drives, A)
    assert [leg.patience_s for leg in drives.legs] == [math.inf, PATIENCE_S, math.inf]
    assert explorer.skipped == [A]


@pytest.mark.parametrize("has_room_near", [True, False])
def test_without_room_at_home_the_robot_drives_near_it(has_room_near: bool) -> None:
    no_room = result(reached=False, reason="no room", failed=True)
    drives = Drives(home=no_room, near_home=result() if has_room_near else no_room)
    total, _, _ = exploration(drives, home=replace(HOME, tolerance_m=0.15))
    assert drives.names == ["initial scan", "home", "near home"]
    assert drives.legs[-1].goal.tolerance_m == NEAR_HOME_M
    assert (total.reached, total.time_s) == (has_room_near, 30.0)
