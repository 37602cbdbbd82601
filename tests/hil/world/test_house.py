"""Random houses: the same number gives the same house, and its goal can be reached."""

import math
from dataclasses import replace

import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper_hil.bench.bench import load_world_for
from thumper_hil.bench.collision import FOOTPRINT_M
from thumper_hil.bench.hardware import robot_params
from thumper_hil.bench.options import BenchOptions
from thumper_hil.effects.friction import floors
from thumper_hil.effects.preset import Preset, load_preset
from thumper_hil.effects.surfaces import Surface
from thumper_hil.world.house import AHEAD_M, MIN_DISTANCE_M, house_mission, house_number, with_dark_legs
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


def test_hard_houses_have_dark_legs_and_some_lie_on_carpet() -> None:
    hard, nominal = load_preset("hard"), load_preset("nominal")
    worlds = [load_world(f"house-{n}", dark_legs_share=hard.house.dark_legs_share) for n in range(1, 21)]
    legs = np.concatenate([world.circle_surfaces for world in worlds]).reshape(-1, 4)
    assert (legs == legs[:, :1]).all()
    assert set(legs[:, 0]) == {int(Surface.MATT), int(Surface.DARK)}
    assert np.mean(legs[:, 0] == Surface.DARK) == pytest.approx(hard.house.dark_legs_share, abs=0.15)
    assert not load_world("house-3").circle_surfaces.any()

    def frictions(preset: Preset, world: str) -> list[float]:
        return [
            robot_params(BenchOptions(world=world.format(n)), preset).body.friction for n in range(1, 201)
        ]

    on_carpet = np.array(frictions(hard, "house-{}")) == floors()["carpet"]
    assert on_carpet.mean() == pytest.approx(hard.house.carpet_share, abs=0.1)
    assert set(frictions(hard, "house-{}")) == {floors()["carpet"], floors()["concrete"]}
    assert set(frictions(nominal, "house-{}")) == {floors()["wood"]}
    assert set(frictions(hard, "lab")) == {floors()["concrete"]}
    stated = replace(BenchOptions(world=f"house-{np.argmax(on_carpet) + 1}"), floor="wood")
    assert robot_params(stated, hard).body.friction == floors()["wood"]


def test_a_simulation_takes_the_dark_legs_of_its_preset() -> None:
    number = next(
        n for n in range(1, 21) if (with_dark_legs(house_mission(n).world, 0.3, n)).circle_surfaces.any()
    )
    for preset, any_dark in (("hard", True), ("nominal", False)):
        world = load_world_for(BenchOptions.parse({"world": f"house-{number}", "preset": preset}))
        assert world.circle_surfaces.any() == any_dark
