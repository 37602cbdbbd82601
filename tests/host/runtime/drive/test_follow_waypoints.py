"""Several goals in one drive: order, result and reason."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import cast

import pytest

from tests.host.runtime.drive.carry_out import carry_out
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.navigation.goal import Goal
from thumper.runtime.drive.legs import AnyLeg, Leg, Wait
from thumper.runtime.drive.tasks import follow_waypoints
from thumper.runtime.drive.waypoints import Waypoint, Waypoints
from thumper.runtime.drive_result import DriveResult

A, B = Goal(x_m=1.0, y_m=0.0), Goal(x_m=0.0, y_m=1.0)


def driver(fails: Callable[[Goal], bool], seen: list[str]) -> Callable[[AnyLeg], DriveResult]:
    def drive(leg: AnyLeg) -> DriveResult:
        assert isinstance(leg, Leg)
        seen.append(leg.name)
        return DriveResult(
            reached=not fails(leg.goal),
            interrupted=False,
            reason="the door is shut" if fails(leg.goal) else "at the goal",
            time_s=5.0,
            path_length_m=1.5,
            pose=Pose2(x_m=leg.goal.x_m, y_m=leg.goal.y_m),
        )

    return drive


def follow(waypoints: Waypoints, drive: Callable[[AnyLeg], DriveResult]) -> DriveResult:
    return carry_out(follow_waypoints(waypoints), drive)


def test_patrol_drives_every_waypoint_in_every_round() -> None:
    seen: list[str] = []
    result = follow(Waypoints.at(A, B, rounds=2), driver(lambda _goal: False, seen))
    assert seen == [f"waypoint {n} of 2, round {lap} of 2" for lap in (1, 2) for n in (1, 2)]
    assert result.reached
    assert (result.time_s, result.path_length_m) == (20.0, 6.0)
    assert result.pose == Pose2(y_m=1.0)


def test_first_failure_ends_the_drive_and_is_named() -> None:
    seen: list[str] = []
    result = follow(Waypoints.at(A, B, A), driver(lambda goal: goal is B, seen))
    assert len(seen) == 2
    assert not result.reached
    assert result.reason == "waypoint 2 of 3 (0.00, 1.00): the door is shut"
    assert result.time_s == 10.0


def test_rejected_first_waypoint_raises_and_a_later_one_ends_the_drive() -> None:
    def rejecting(bad: Goal) -> Callable[[AnyLeg], DriveResult]:
        def drive(leg: AnyLeg) -> DriveResult:
            assert isinstance(leg, Leg)
            if leg.goal is bad:
                raise ThumperError("too near an obstacle")
            return driver(lambda _goal: False, [])(leg)

        return drive

    with pytest.raises(ThumperError, match="too near"):
        follow(Waypoints.at(A, B), rejecting(A))
    result = follow(Waypoints.at(A, B), rejecting(B))
    assert not result.reached
    assert result.reason == "waypoint 2 of 2 (0.00, 1.00): too near an obstacle"


@pytest.mark.parametrize("why", ["", "the disk is full"])
def test_it_records_while_it_waits_where_a_waypoint_asks_for_it(why: str) -> None:
    seen: list[str] = []

    @contextmanager
    def recording() -> Iterator[None]:
        if why:
            raise ThumperError(why)
        seen.append("record")
        yield
        seen.append("stop")

    def drive(leg: AnyLeg) -> DriveResult:
        seen.append(type(leg).__name__)
        return driver(lambda _goal: False, [])(Leg(goal=A))

    points = (Waypoint(goal=A, wait_s=4.0), Waypoint(goal=B, wait_s=4.0, record=True))
    task = follow_waypoints(Waypoints(points=points), recording=recording)
    result = carry_out(task, drive)
    assert result.reached is not bool(why)
    waits = [] if why else ["record", "Wait", "stop"]
    assert seen == ["Leg", "Wait", "Leg", *waits]
    assert result.reason == (f"waypoint 2 of 2 (0.00, 1.00): {why}" if why else "at the goal")


@pytest.mark.parametrize("is_cancelled", [False, True])
def test_it_waits_at_each_waypoint_before_it_drives_on(*, is_cancelled: bool) -> None:
    seen: list[str | float] = []

    def drive(leg: AnyLeg) -> DriveResult:
        if not isinstance(leg, Wait):
            return driver(lambda _goal: False, cast("list[str]", seen))(leg)
        seen.append(leg.duration_s)
        waited = driver(lambda _goal: is_cancelled, [])(Leg(goal=B))
        return replace(waited, reason="cancelled" if is_cancelled else "done", path_length_m=0.0)

    result = follow(Waypoints(points=(Waypoint(goal=A, wait_s=4.0), Waypoint(goal=B)), rounds=2), drive)
    assert result.reached is not is_cancelled
    if is_cancelled:
        assert seen == ["waypoint 1 of 2, round 1 of 2", 4.0]
        assert result.reason == "waypoint 1 of 2, round 1 of 2 (1.00, 0.00): cancelled"
    else:
        assert [one for one in seen if isinstance(one, float)] == [4.0, 4.0]
        assert (result.reason, result.time_s, result.path_length_m) == ("at the goal", 30.0, 6.0)
