"""Tasks answer "what next?" after each leg."""

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
from thumper.navigation.planners.frontier_exploration import Explorer
from thumper.runtime.drive.legs import AnyLeg, Wait
from thumper.runtime.drive.tasks import drive_to_goal, explore
from thumper.runtime.drive_result import DriveResult

HOME, A, B = Goal(x_m=0.0, y_m=0.0), Goal(x_m=1.0, y_m=0.0), Goal(x_m=2.0, y_m=0.0)
GRID = OccupancyGrid(cells=np.zeros((4, 4), np.int8), resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)


class Frontiers:
    """An explorer with a fixed list of frontiers, each found in the twelfth slice."""

    def __init__(self, *goals: Goal) -> None:
        self._goals = list(goals)

    def search(self, _grid: OccupancyGrid, _map_from_base: Pose2) -> Search[Goal | None]:
        for _ in range(11):
            yield
        return self._goals.pop(0) if self._goals else None


class Drives:
    """Drives 10 s and 1 m per leg; `ends` changes the result of a goal or raises an error."""

    def __init__(self, **ends: DriveResult | ThumperError) -> None:
        self._ends = ends
        self.names: list[str] = []
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
        self.names.append(leg.name)
        end = self._ends.get(leg.name.replace(" ", "_"), result())
        if isinstance(end, ThumperError):
            raise end
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
        map_from_base=Pose2(),
        navigation_failed=failed,
    )


def exploration(drives: Drives, *frontiers: Goal, limit_s: float = 900.0) -> tuple[DriveResult, list[str]]:
    reports: list[str] = []
    explorer = cast("Explorer", Frontiers(*frontiers))
    task = explore(explorer, lambda: GRID, HOME, limit_s=limit_s, report=reports.append)
    return carry_out(task, drives), reports


def test_exploration_scans_visits_all_frontiers_and_returns() -> None:
    drives = Drives()
    total, reports = exploration(drives, A, B)
    assert drives.names == ["initial scan", "frontier 1", "frontier 2", "home"]
    assert (total.reached, total.time_s, total.path_length_m) == (True, 40.0, 4.0)
    assert reports == ["explored after 30 s: reached 2 of 2 frontiers"]


def test_the_robot_runs_its_cycles_while_it_chooses_a_frontier() -> None:
    """Each cycle does three slices. Three searches: two frontiers, and the answer that none is left."""
    drives = Drives()
    exploration(drives, A, B)
    assert drives.waited == [4, 4, 4]


def test_a_robot_that_fails_while_it_chooses_a_frontier_tries_to_return() -> None:
    drives = Drives(wait=result(reached=False, reason="the board went silent"))
    _, reports = exploration(drives, A)
    assert drives.names == ["initial scan", "home"]
    assert reports == ["ended after 20 s: the board went silent"]


def test_an_unreachable_frontier_is_given_up_and_the_next_one_tried() -> None:
    drives = Drives(frontier_1=result(reached=False, reason="no path", failed=True))
    total, reports = exploration(drives, A, B)
    assert drives.names == ["initial scan", "frontier 1", "frontier 2", "home"]
    assert total.reached
    assert reports == [
        "gave up frontier 1 at (1.00, 0.00): no path",
        "explored after 30 s: reached 1 of 2 frontiers",
    ]


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
    total, reports = exploration(drives, A, B)
    assert drives.names == ["initial scan", "frontier 1", "home"]
    assert (total.reached, total.reason) == (False, "still no scans")
    assert reports == [ending]


def test_after_ctrl_c_nothing_is_driven() -> None:
    drives = Drives(frontier_1=result(reached=False, interrupted=True, reason="interrupted"))
    total, reports = exploration(drives, A, B)
    assert drives.names == ["initial scan", "frontier 1"]
    assert (total.interrupted, total.reason, total.time_s) == (True, "interrupted", 20.0)
    assert reports == ["interrupted after 20 s: reached 0 of 1 frontiers"]


def test_when_time_is_up_the_robot_returns() -> None:
    drives = Drives()
    _, reports = exploration(drives, A, B, limit_s=15.0)
    assert drives.names == ["initial scan", "frontier 1", "home"]
    assert reports == ["time is up after 20 s: reached 1 of 1 frontiers"]


def test_nothing_to_explore() -> None:
    _, reports = exploration(Drives())
    assert reports == ["nothing to explore here: no frontier is reachable"]


def test_a_refused_only_leg_raises_the_refusal() -> None:
    with pytest.raises(ThumperError, match="no telemetry"):
        carry_out(drive_to_goal(A), Drives(driving=ThumperError("no telemetry")))
