"""The order of the checks: dynamic obstacles first, then smoothing, slowing, the monitor, and the escape."""

import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.host.navigation.safety.test_escape import request
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.controllers.controller import ControlResult
from thumper.navigation.costmap.local_model import NO_OBSTACLES, ObstaclePoints
from thumper.navigation.footprint import Footprint
from thumper.navigation.safety.collision_monitor import CollisionMonitorOptions
from thumper.navigation.safety.command_filter import (
    GIVING_WAY_S,
    PRIORITY_S,
    WAITING_S,
    WALKING_MARGIN_M,
    CommandFilter,
    FilteredCommand,
)
from thumper.navigation.safety.dynamic_obstacles import DynamicObstacleOptions, MovingObject
from thumper.navigation.safety.tracks import STEPS
from thumper.navigation.speed_limits import SpeedLimits

SLOW = Twist2(v_m_s=0.04)
PERIOD_S = 0.1
NONE = np.empty((0, 2))
FRONT_M = 0.21
WALL_M = np.column_stack((np.full(161, 3.0), np.linspace(-4.0, 4.0, 161)))


class Filter:
    """A command filter whose obstacles and dynamic obstacles a test sets."""

    def __init__(self, ahead_s: float = 2.0, view: FieldOfView | None = None) -> None:
        self.filter = CommandFilter(
            limits=SpeedLimits(),
            monitor=CollisionMonitorOptions(),
            dynamic_obstacles=DynamicObstacleOptions(ahead_s=ahead_s),
            footprint=Footprint(),
            padded=Footprint(),
            drive=None,
            view=view or FieldOfView(),
        )
        self.yields_to: list[Twist2] = []
        vars(self.filter._dynamic_obstacles)["stop_reason"] = self._stop_reason

    def _stop_reason(
        self, command: Twist2, _twist: Twist2, _pose: Pose2, moving: list[MovingObject]
    ) -> str | None:
        assert command is not None
        return "a person" if command in self.yields_to and moving else None

    def sees_person(self, *, untracked: bool, away_m: float = 1.0) -> None:
        """Let a person move, who is or is not a part of a track."""
        person = MovingObject(np.full((3, 2), (away_m, 0.0)), np.array((1.0, 0.0)))
        self.filter._dynamic_obstacles.moving = [person]
        self.filter._tracks.untracked = [person] * untracked

    def gives_way(self) -> None:
        """Let a person with a track stand in the robot's path."""
        vars(self.filter._tracks)["moving"] = lambda: [SimpleNamespace(speed_m_s=1.0)]
        vars(self.filter)["_predicted"] = lambda: np.full((STEPS, 1, 3), 0.3)

    def run(
        self,
        wanted: Twist2 | None,
        points_m: FloatArray = NONE,
        *,
        allow_escape: bool = True,
        last: Twist2 = SLOW,
        twist: Twist2 | None = None,
        seen: int | None = None,
    ) -> FilteredCommand:
        count = len(points_m)
        self.filter._obstacles = ObstaclePoints(points_m, np.zeros(count), count if seen is None else seen)
        asked = replace(request(points_m), last_command=last)
        if twist is not None:
            asked = replace(asked, twist=twist)
        result = ControlResult(command=wanted, reason="" if wanted else "no room")
        return self.filter.filter(result, asked, allow_escape=allow_escape)


def test_free_command_passes_within_the_acceleration_limits() -> None:
    assert Filter().run(SLOW) == FilteredCommand(command=SLOW)
    passed = Filter().run(Twist2(v_m_s=0.4), last=Twist2())
    assert passed.command is not None
    assert passed.command.v_m_s == pytest.approx(0.04)


def test_command_is_slowed_before_an_obstacle() -> None:
    slowed = Filter().run(Twist2(v_m_s=0.4), np.array(((0.58, 0.0),)), last=Twist2(v_m_s=0.4)).command
    assert slowed is not None
    assert 0.1 < slowed.v_m_s < 0.39


@pytest.mark.parametrize(
    ("untracked", "allow_escape", "yields"), [(False, False, True), (True, True, True), (False, True, False)]
)
def test_robot_waits_for_a_dynamic_obstacle_that_it_gives_no_way(
    untracked: bool, allow_escape: bool, yields: bool
) -> None:
    checked = Filter()
    checked.yields_to = [SLOW]
    checked.sees_person(untracked=untracked)
    waits = FilteredCommand(command=Twist2(), reason="a person", yielding=True)
    assert checked.run(SLOW, allow_escape=allow_escape) == (
        waits if yields else FilteredCommand(command=SLOW)
    )


@pytest.mark.parametrize("known", [False, True])
def test_robot_stops_for_somebody_who_has_just_come_into_view_nearby(known: bool) -> None:
    """How they walk is not known, so no plan round them is made yet."""
    checked = Filter()
    checked.gives_way()
    vars(checked.filter._tracks)["has_unknown_near"] = lambda _at_m: not known
    passed = checked.run(SLOW, twist=Twist2(v_m_s=0.4), last=Twist2(v_m_s=0.4))
    assert passed.yielding
    assert passed.reason.startswith("giving way" if known else "waiting")
    assert known or (passed.command is not None and passed.command.v_m_s < 0.4 and not passed.command.w_rad_s)


def test_robot_gives_way_without_driving_toward_a_second_person() -> None:
    def steps_aside(_request: object, _discs: object, allowed: Callable[[Twist2], Twist2 | None]) -> Twist2:
        return allowed(SLOW) or Twist2()

    checked = Filter()
    checked.gives_way()
    vars(checked.filter._give_way)["best_command"] = steps_aside
    checked.yields_to = [SLOW]
    assert checked.run(SLOW).command == SLOW
    checked.sees_person(untracked=True)
    waiting = checked.run(SLOW)
    assert waiting.command == Twist2()
    assert waiting.yielding


@pytest.mark.parametrize("walks", [False, True])
def test_robot_that_gives_way_is_slowed_before_what_does_not_walk(walks: bool) -> None:
    fast = Twist2(v_m_s=0.4)

    def straight_on(_request: object, _discs: object, allowed: Callable[[Twist2], Twist2 | None]) -> Twist2:
        return allowed(fast) or Twist2()

    checked = Filter()
    checked.gives_way()
    vars(checked.filter._give_way)["best_command"] = straight_on
    vars(checked.filter)["are_walking"] = lambda points_m: np.full(len(points_m), walks)
    command = checked.run(fast, np.array(((0.58, 0.0),)), last=fast).command
    assert command is not None
    assert (command.v_m_s < 0.39) is not walks


@pytest.mark.parametrize("opening_rad", [math.radians(240.0), math.tau])
def test_robot_sweeps_its_tail_over_no_foot_that_is_put_down_out_of_view(opening_rad: float) -> None:
    """Somebody walks past the robot's left side. Beside the tail the lidar with 240 degrees sees no foot."""
    checked = Filter(view=FieldOfView(opening_rad=opening_rad))
    for k in range(12):
        centre_m = np.array((0.85 - 0.08 * k, 0.24))
        walker_m = centre_m + 0.06 * np.column_stack([f(np.linspace(3.5, 5.5, 8)) for f in (np.cos, np.sin)])
        hits_m = np.vstack((walker_m, WALL_M)) if centre_m[0] > 0.0 else WALL_M
        model: Any = SimpleNamespace(
            map_from_local=Pose2(), hits_m=hits_m, obstacles=NO_OBSTACLES, costmap=None
        )
        cycle: Any = SimpleNamespace(time_s=0.1 * k, scan_pose=Pose2(), map_from_base=Pose2())
        checked.filter.update(cycle, model)
    assert checked.filter._tracks.tracks
    obstacles = checked.filter._obstacles
    right, left = (
        checked.filter._monitor.stop_reason(
            Twist2(w_rad_s=w_rad_s), Twist2(), obstacles.points_m, obstacles.position_error_m, PERIOD_S
        )
        for w_rad_s in (-0.6, 0.6)
    )
    assert (right is None) is (opening_rad == math.tau)
    assert left is None


@pytest.mark.parametrize("opening_rad", [math.radians(240.0), math.tau])
def test_robot_gives_way_backward_only_if_it_sees_behind(opening_rad: float) -> None:
    back = Twist2(v_m_s=-0.1)

    def backs_off(_request: object, _discs: object, allowed: Callable[[Twist2], Twist2 | None]) -> Twist2:
        return allowed(back) or Twist2()

    checked = Filter(view=FieldOfView(opening_rad=opening_rad))
    checked.gives_way()
    vars(checked.filter._give_way)["best_command"] = backs_off
    command = checked.run(SLOW, last=Twist2(v_m_s=-0.06)).command
    assert command is not None
    assert command.v_m_s == pytest.approx(-0.1 if opening_rad == math.tau else -0.02)


@pytest.mark.parametrize("allow_escape", [True, False])
def test_robot_does_not_wait_for_ever_for_what_has_no_track(*, allow_escape: bool) -> None:
    checked, waiting = Filter(), 0
    checked.yields_to = [SLOW]
    checked.sees_person(untracked=True)
    while checked.run(SLOW, allow_escape=allow_escape).yielding:
        waiting += 1
    assert waiting == pytest.approx(WAITING_S / PERIOD_S, abs=1)
    if not allow_escape:  # a person with a track is waited for as before
        checked.sees_person(untracked=False)
        assert checked.run(SLOW, allow_escape=False).yielding


def test_robot_that_gives_no_way_waits_for_who_walks_also_while_their_foot_rests() -> None:
    checked, person = Filter(), MovingObject(np.zeros((3, 2)), np.array((1.0, 0.0)))
    checked.yields_to = [SLOW]
    assert not checked.run(SLOW, allow_escape=False).yielding
    vars(checked.filter._tracks)["outlines"] = lambda: [person]
    assert checked.run(SLOW, allow_escape=False).yielding


def test_robot_has_priority_after_it_gave_way_for_long() -> None:
    checked = Filter()
    checked.gives_way()
    waiting = 0
    while "giving way" in (reason := checked.run(SLOW).reason) or "waiting" in reason:
        waiting += 1
    assert waiting == pytest.approx(GIVING_WAY_S / PERIOD_S, abs=1)
    driving = 1
    while checked.run(SLOW).reason == "":
        driving += 1
    assert driving == pytest.approx(PRIORITY_S / PERIOD_S, abs=15)


@pytest.mark.parametrize(
    ("ahead_s", "rests", "walks"), [(2.0, False, True), (2.0, True, False), (0.0, False, False)]
)
def test_who_walks_is_no_obstacle_for_a_robot_that_gives_way(
    ahead_s: float, rests: bool, walks: bool
) -> None:
    checked = Filter(ahead_s)
    vars(checked.filter._tracks)["are_near"] = lambda points_m: np.hypot(*points_m.T) < 1.0
    vars(checked.filter._dynamic_obstacles)["rested"] = lambda points_m: np.full(len(points_m), rests)
    assert checked.filter.are_walking(np.array(((0.5, 0.0), (1.5, 0.0)))).tolist() == [walks, False]


def test_rejected_command_is_replaced_only_if_that_is_allowed() -> None:
    ahead = np.array(((FRONT_M + 0.001, 0.0),))
    fast = Twist2(v_m_s=0.3)
    rejected = Filter().run(fast, ahead, allow_escape=False, last=Twist2())
    assert rejected.command is None
    assert not (rejected.escaping)
    assert not (rejected.yielding)
    assert "an obstacle" in rejected.reason
    escaped = Filter().run(fast, ahead, last=Twist2())
    assert escaped.escaping
    assert not escaped.yielding
    assert escaped.command is not None
    assert escaped.command.v_m_s <= 0.0
    assert escaped.reason.startswith("escaping: stopped before an obstacle")


def test_unseen_ground_is_named() -> None:
    ahead = np.array(((FRONT_M + 0.001, 0.0),))
    assert "never seen" in Filter().run(Twist2(v_m_s=0.3), ahead, allow_escape=False, seen=0).reason


def test_controller_without_a_command_keeps_its_reason() -> None:
    rejected = FilteredCommand(command=None, reason="no room", slowing=Twist2())
    assert Filter().run(None, allow_escape=False) == rejected


@pytest.mark.parametrize(("obstacle_x_m", "v_m_s"), [(1.0, 0.36), (0.55, 0.36), (0.45, 0.0)])
def test_robot_brakes_hard_only_if_it_must(obstacle_x_m: float, v_m_s: float) -> None:
    """The front is at 0.21 m. A normal stop from 0.4 m/s takes 0.28 m, and the margin 0.02 m."""
    fast = Twist2(v_m_s=0.4)
    points_m = np.array(((obstacle_x_m, 0.0),))
    rejected = Filter().run(None, points_m, allow_escape=False, last=fast, twist=fast)
    assert rejected.command is None
    assert rejected.slowing.v_m_s == pytest.approx(v_m_s)
    waits = Filter()
    waits.yields_to = [fast]
    waits.sees_person(untracked=True)
    waiting = waits.run(fast, points_m, allow_escape=False, last=fast, twist=fast)
    assert waiting.yielding
    assert waiting.command is not None
    assert waiting.command.v_m_s == pytest.approx(v_m_s)


@pytest.mark.parametrize(("away_m", "v_m_s"), [(0.6, 0.0), (0.8, 0.36)])
def test_robot_brakes_as_hard_as_it_can_when_somebody_steps_close(away_m: float, v_m_s: float) -> None:
    fast = Twist2(v_m_s=0.4)
    waits = Filter()
    waits.yields_to = [fast]
    waits.sees_person(untracked=True, away_m=away_m)
    waiting = waits.run(fast, last=fast, twist=fast)
    assert waiting.yielding
    assert waiting.command == Twist2(v_m_s=pytest.approx(v_m_s))  # type: ignore[arg-type]


def test_slowing_down_before_an_obstacle_is_no_hard_braking() -> None:
    """The slow zone may ask for 40 %; the command falls by 0.4 m/s^2."""
    fast = Twist2(v_m_s=0.4)
    slowed = Filter().run(fast, np.array(((0.52, 0.0),)), last=fast, twist=Twist2(v_m_s=0.1)).command
    assert slowed is not None
    assert slowed.v_m_s == pytest.approx(0.36)


def test_no_escape_toward_a_dynamic_obstacle() -> None:
    ahead = np.array(((FRONT_M + 0.001, 0.0),))
    fast = Twist2(v_m_s=0.3)
    free = Filter().run(fast, ahead, last=Twist2())
    assert free.command is not None
    checked = Filter()
    checked.sees_person(untracked=False)
    checked.yields_to = [free.command]
    assert checked.run(fast, ahead, last=Twist2()).command is None


def test_who_walks_is_followed_across_a_jump_of_the_map() -> None:
    """The robot does not move, somebody crosses; then the map moves both by 0.5 m."""
    checked = Filter()
    for k in range(16):
        jump = Pose2(y_m=0.5 if k >= 12 else 0.0)
        walker_m = np.array((2.0, -0.6 + 0.08 * k)) + 0.06 * np.column_stack(
            [f(np.linspace(2.5, 3.8, 8)) for f in (np.cos, np.sin)]
        )
        model: Any = SimpleNamespace(
            map_from_local=jump,
            hits_m=jump.apply(np.vstack((WALL_M, walker_m))),
            obstacles=ObstaclePoints(jump.apply(np.array(((1.5, 0.0),))), np.zeros(1), 1),
            costmap=None,
        )
        cycle: Any = SimpleNamespace(time_s=0.1 * k, scan_pose=jump, map_from_base=jump)
        checked.filter.update(cycle, model)
    (track,) = checked.filter._tracks.tracks
    assert track.centre_m == pytest.approx((2.0, 1.1), abs=0.15)
    assert track.velocity_m_s == pytest.approx((0.0, 0.8), abs=0.25)
    assert checked.filter._obstacles.points_m[0] == pytest.approx((1.5, 0.0))


@pytest.mark.parametrize(("ahead_s", "margin_m"), [(2.0, WALKING_MARGIN_M), (0.0, 0.0)])
def test_robot_keeps_more_room_to_who_walks(ahead_s: float, margin_m: float) -> None:
    checked = Filter(ahead_s)
    vars(checked.filter._tracks)["are_near"] = lambda points_m: points_m[:, 0] < 1.0
    points_m = np.array(((0.5, 0.0), (1.5, 0.0)))
    model: Any = SimpleNamespace(
        map_from_local=Pose2(),
        hits_m=NONE,
        obstacles=ObstaclePoints(points_m, np.full(2, 0.01), 2),
        costmap=None,
    )
    cycle: Any = SimpleNamespace(time_s=0.0, scan_pose=Pose2(), map_from_base=Pose2())
    checked.filter.update(cycle, model)
    assert checked.filter._obstacles.position_error_m == pytest.approx([0.01 + margin_m, 0.01])
