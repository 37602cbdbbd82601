"""People at 1 m/s who cross, approach or block the path: the robot never drives into anyone."""

import math
from collections.abc import Callable

import pytest

from thumper.common.geometry import Pose2
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationState
from thumper.navigation.speed_limits import SpeedLimits
from thumper_hil.kinematic.closed_loop import drive
from thumper_hil.kinematic.people import (
    KinematicPedestrian,
    approach_speed_m_s,
    classify_contact,
    visible_s,
    with_people,
)
from thumper_hil.kinematic.world import KinematicWorld, box

HALL = KinematicWorld.from_boxes(box(2.0, 0.0, 7.0, 4.0))
AREA = (-4.0, -4.0, 12.0, 8.0)
START, GOAL = Pose2(x_m=0.0, y_m=0.0), Goal(x_m=4.5, y_m=0.0)


def seen(walkers: list[KinematicPedestrian]) -> Callable[[float], KinematicWorld]:
    return lambda time_s: with_people(HALL, walkers, time_s)


CROSSING = [KinematicPedestrian(a_m=(2.0, -1.7), b_m=(2.0, 1.7), from_s=t) for t in (0.0, 1.0, 2.0, 3.0)]
TWO = [
    KinematicPedestrian(a_m=(1.6, -1.7), b_m=(1.6, 1.7), from_s=0.5),
    KinematicPedestrian(a_m=(3.0, 1.7), b_m=(3.0, -1.7), from_s=1.5),
]
BLOCKING = [KinematicPedestrian(a_m=(2.0, 0.0), b_m=(2.0, 1.6), from_s=12.0)]
STAYING = [KinematicPedestrian(a_m=(2.0, 0.0), b_m=(2.0, 0.0))]


@pytest.mark.parametrize(
    "walkers",
    [*([walker] for walker in CROSSING), TWO, BLOCKING, STAYING],
    ids=["cross 0 s", "cross 1 s", "cross 2 s", "cross 3 s", "two", "blocks, then goes", "stays"],
)
def test_drives_into_nobody(walkers: list[KinematicPedestrian]) -> None:
    run = drive(seen(walkers), START, GOAL, AREA, limit_s=60.0)
    if run.clearance_m < 0.0:  # somebody walked into it
        assert classify_contact(run.track, walkers, run.time_s, SpeedLimits()) != "drove into a person"
    else:
        assert run.state is NavigationState.REACHED, run.reason
        assert run.goal_error_m < 0.12


@pytest.mark.parametrize(
    ("place_m", "approach_m_s"), [((0.45, 0.0), 0.4), ((-0.4, 0.0), -0.4), ((0.0, 0.4), 0.0)]
)
def test_approach_speed_by_direction(place_m: tuple[float, float], approach_m_s: float) -> None:
    """The robot drives toward a person ahead, away from one behind, and past one beside it."""
    ahead, person = Pose2(x_m=0.04), KinematicPedestrian(a_m=place_m, b_m=place_m)
    assert approach_speed_m_s(Pose2(), ahead, person, 1.0) == pytest.approx(approach_m_s, abs=0.03)
    assert approach_speed_m_s(ahead, ahead, person, 1.0) == 0.0


def test_visible_time_starts_when_a_person_comes_into_view() -> None:
    """On a line across: 1 m behind the lidar, always out of view, and 1 m in front of it."""
    track = [Pose2()] * 31
    behind, in_front = (KinematicPedestrian(a_m=(x_m, -1.5), b_m=(x_m, 1.5)) for x_m in (-0.88, 1.12))
    assert visible_s(track, behind, 3.0) == pytest.approx(0.0, abs=0.1)
    assert visible_s(track, in_front, 3.0) == pytest.approx(3.1)


@pytest.mark.parametrize(
    ("speed_m_s", "x_m", "what"),
    [(0.4, 0.4, "drove into a person"), (0.0, 0.4, "walked into"), (-0.4, -0.4, "caught from behind")],
)
def test_cause_of_a_contact(speed_m_s: float, x_m: float, what: str) -> None:
    """Driving at somebody for 3 s, stopped in front of them, backing into one never in view."""
    track = [Pose2(x_m=speed_m_s * 0.1 * (cycle - 30)) for cycle in range(31)]
    assert (
        classify_contact(track, [KinematicPedestrian(a_m=(x_m, 0.0), b_m=(x_m, 0.0))], 3.0, SpeedLimits())
        == what
    )


def test_permanently_blocked_corridor_fails_with_a_reason() -> None:
    """Three people stand shoulder to shoulder in a corridor."""
    corridor = KinematicWorld.from_boxes(box(2.0, 0.0, 7.0, 1.4))
    people = [KinematicPedestrian(a_m=(2.5, y_m), b_m=(2.5, y_m)) for y_m in (-0.45, 0.0, 0.45)]
    run = drive(lambda time_s: with_people(corridor, people, time_s), START, GOAL, AREA, limit_s=120.0)
    assert run.state is NavigationState.FAILED
    assert "no path" in run.reason
    assert run.clearance_m > 0.0
    assert math.dist((run.track[-1].x_m, run.track[-1].y_m), (0.0, 0.0)) < 2.3
