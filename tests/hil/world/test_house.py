"""Random houses: the same number gives the same house, and its goal can be reached."""

import math

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper_hil.bench.collision import FOOTPRINT_M
from thumper_hil.effects.surfaces import Surface
from thumper_hil.world.house import AHEAD_M, MIN_DISTANCE_M, house_mission, house_number
from thumper_hil.world.load_world import load_world
from thumper_hil.world.start_pose import invalid_start_reason

NUMBERS = range(1, 7)


def test_the_same_number_gives_the_same_house() -> None:
    first = house_mission(3)
    house_mission.cache_clear()
    again = house_mission(3)
    assert np.array_equal(first.world.segments_m, again.world.segments_m)
    assert (first.start, first.goal_m) == (again.start, again.goal_m)
    assert not np.array_equal(first.world.segments_m, house_mission(4).world.segments_m)
    assert np.array_equal(load_world("house-3").segments_m, first.world.segments_m)


@pytest.mark.parametrize("number", NUMBERS)
def test_start_and_goal_are_free_in_any_heading(number: int) -> None:
    mission = house_mission(number)
    assert not invalid_start_reason(mission.world, mission.start, FOOTPRINT_M)
    x_m, y_m = mission.goal_m
    for yaw_rad in np.linspace(0.0, math.tau, 24):
        goal = Pose2(x_m=x_m, y_m=y_m, theta_rad=float(yaw_rad))
        assert mission.world.clearance_m(goal, FOOTPRINT_M) > 0.02
    assert math.dist((mission.start.x_m, mission.start.y_m), mission.goal_m) > MIN_DISTANCE_M


@pytest.mark.parametrize("number", NUMBERS)
def test_the_robot_starts_with_free_floor_ahead(number: int) -> None:
    mission = house_mission(number)
    start = mission.start
    ahead_rad = start.theta_rad + np.linspace(-0.5, 0.5, 11)
    assert mission.world.cast(start.x_m, start.y_m, ahead_rad).min() > AHEAD_M


def test_houses_have_everything_that_is_hard() -> None:
    worlds = [house_mission(number).world for number in NUMBERS]
    surfaces = {int(surface) for world in worlds for surface in world.segment_surfaces}
    assert surfaces == {int(surface) for surface in Surface}
    assert any(world.sills_m.size for world in worlds)
    assert any(world.walkers for world in worlds)
    assert any((world.circles_m[:, 2] == 0.015).any() for world in worlds)  # legs of chairs


def test_only_a_number_names_a_house() -> None:
    assert house_number("house-17") == 17
    assert house_number("house") is house_number("house-x") is house_number("lab") is None
