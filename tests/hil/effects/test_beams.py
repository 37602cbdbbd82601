"""Beams: glass, dark and shiny surfaces, edges, self-returns, drop-outs, floor, mounting and clocks."""

import math
from dataclasses import replace
from typing import Literal
from unittest.mock import patch

import numpy as np
import pytest

from tests.variants import some_of
from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.open_lidar import open_lidar
from thumper.lidar.options import LidarOptions
from thumper_hil.bench.hardware import SILENT
from thumper_hil.effects.clock_drift import clock_drifts
from thumper_hil.effects.mixed_pixels import mix_at_edges
from thumper_hil.effects.mounting import true_mounting
from thumper_hil.effects.preset import LidarEffects, load_preset
from thumper_hil.effects.surfaces import Surface
from thumper_hil.lidars.beams import BeamConditions, Beams
from thumper_hil.world.world import World

HARD = load_preset("hard")
BEARINGS_RAD = np.radians(np.arange(-60.0, 60.5, 0.5))


def wall(surface: Surface, behind_m: float = 3.0) -> World:
    """Return a wall 1 m in front of the origin, and a matt one behind it."""
    segments_m = np.array([[1.0, -5.0, 1.0, 5.0], [behind_m, -9.0, behind_m, 9.0]])
    return World(
        segments_m=segments_m,
        circles_m=np.zeros((0, 3)),
        segment_surfaces=np.array([surface, Surface.MATT], np.int8),
    )


def cast(world: World, effects: LidarEffects = SILENT, pitch_rad: float = 0.0) -> FloatArray:
    beams = Beams(
        world=world,
        pose_at=lambda times_s: np.zeros((times_s.size, 3)),
        base_from_laser=Pose2(),
        range_max_m=5.6,
        conditions=BeamConditions(effects=effects, tilt_rad=pitch_rad),
    )
    return beams.cast(np.zeros(BEARINGS_RAD.size), BEARINGS_RAD, np.random.default_rng(1))


def test_glass_is_seen_along_its_normal_only() -> None:
    ranges_m = cast(wall(Surface.GLASS))
    near = np.abs(BEARINGS_RAD) < math.radians(9.0)
    far = np.abs(BEARINGS_RAD) > math.radians(11.0)
    assert ranges_m[near] == pytest.approx(1.0 / np.cos(BEARINGS_RAD[near]))
    assert ranges_m[far] == pytest.approx(3.0 / np.cos(BEARINGS_RAD[far]))


def test_shiny_surfaces_vanish_under_an_angle_and_dark_ones_with_distance() -> None:
    shiny = cast(wall(Surface.SHINY))
    oblique = np.abs(BEARINGS_RAD) > math.radians(26.0)
    assert np.isinf(shiny[oblique]).mean() == pytest.approx(0.8, abs=0.12)
    assert np.isfinite(shiny[np.abs(BEARINGS_RAD) < math.radians(24.0)]).all()
    dark = cast(wall(Surface.DARK))
    assert 0.2 < np.isinf(dark).mean() < 0.8
    assert np.isfinite(cast(wall(Surface.MATT))).all()


def test_a_grazing_beam_returns_nothing() -> None:
    lost = np.isinf(cast(wall(Surface.MATT), replace(SILENT, grazing_deg=50.0)))
    assert lost[np.abs(BEARINGS_RAD) > math.radians(51.0)].all()
    assert not lost[np.abs(BEARINGS_RAD) < math.radians(49.0)].any()


def test_edges_mix_front_and_background() -> None:
    ranges_m = np.tile([1.0, 1.0, 2.0, 2.0], 500)
    mixed = mix_at_edges(ranges_m, 5.6, 0.3, np.random.default_rng(1))
    between = (mixed > 1.01) & (mixed < 1.99)
    assert between.sum() == pytest.approx(0.3 * 999, rel=0.15)
    assert np.array_equal(mix_at_edges(ranges_m, 1.5, 0.3, np.random.default_rng(1)), ranges_m)


def test_a_cable_shows_in_some_scans() -> None:
    effects = replace(SILENT, self_return_share=1.0)
    beams = np.radians(np.arange(90.5, 120.0))
    world = Beams(
        world=wall(Surface.MATT),
        pose_at=lambda times_s: np.zeros((times_s.size, 3)),
        base_from_laser=Pose2(),
        range_max_m=5.6,
        conditions=BeamConditions(effects=effects),
    )
    ranges_m = world.cast(np.zeros(beams.size), beams, np.random.default_rng(1))
    assert (ranges_m == 0.09).sum() == 4  # 4 degrees


def test_drop_outs_come_in_runs_at_the_given_share() -> None:
    effects = replace(SILENT, loss_share=0.05)
    world = wall(Surface.MATT)
    rng = np.random.default_rng(1)
    beams = Beams(
        world=world,
        pose_at=lambda times_s: np.zeros((times_s.size, 3)),
        base_from_laser=Pose2(),
        range_max_m=5.6,
        conditions=BeamConditions(effects=effects),
    )
    zeros = np.zeros(BEARINGS_RAD.size)
    lost = np.concatenate([np.isinf(beams.cast(zeros, BEARINGS_RAD, rng)) for _ in range(200)])
    assert lost.mean() == pytest.approx(0.05, rel=0.15)


def test_a_tilted_lidar_sees_the_floor() -> None:
    ranges_m = cast(wall(Surface.GLASS, behind_m=5.0), pitch_rad=math.radians(3.0))
    ahead = (np.abs(BEARINGS_RAD) > math.radians(11.0)) & (np.abs(BEARINGS_RAD) < math.radians(30.0))
    expected_m = 0.2 / (math.tan(math.radians(3.0)) * np.cos(BEARINGS_RAD[ahead]))
    assert ranges_m[ahead] == pytest.approx(expected_m)


def test_the_bracket_is_off_within_its_bounds_by_seed() -> None:
    nominal = Pose2(x_m=0.12)
    mounts = [true_mounting(nominal, HARD.mount, seed) for seed in range(200)]
    yaws_deg = np.degrees([mount.base_from_laser.theta_rad for mount in mounts])
    x_off_m = np.array([mount.base_from_laser.x_m for mount in mounts]) - 0.12
    assert np.abs(yaws_deg).max() <= 1.0
    assert np.abs(yaws_deg).mean() == pytest.approx(0.5, abs=0.08)
    assert 0.008 < np.abs(x_off_m).max() <= 0.01
    assert true_mounting(nominal, load_preset("nominal").mount, 3).base_from_laser == nominal


def test_clocks_drift_within_half_a_percent_by_seed() -> None:
    drifts = np.array([clock_drifts(HARD.clock, seed) for seed in range(200)])
    assert np.abs(drifts).max() <= 0.005
    assert np.abs(drifts).mean() == pytest.approx(0.0025, rel=0.15)
    assert clock_drifts(load_preset("nominal").clock, 3) == (0.0, 0.0)


def arrivals_s(name: str, model: Literal["urg04lx", "ld19"], delay_s: float) -> FloatArray:
    """Return when the first 40 scans reach the host."""
    preset = load_preset("nominal")
    preset = replace(preset, lidar=replace(preset.lidar, delay_s=delay_s))
    with patch("thumper_hil.bench.bench.load_preset", lambda _name: preset):
        lidar = open_lidar(LidarOptions(port=f"sim://{name}/lidar?world=hall&lidar={model}", model=model))
    arrived_s = []
    for _ in range(40):
        lidar.wait_for_sample(2.0)
        arrived_s.append(lidar.now_s())
    lidar.close()
    return np.array(arrived_s)


@pytest.mark.parametrize("model", some_of(["urg04lx", "ld19"]))
def test_scans_arrive_late_by_up_to_the_delay(model: Literal["urg04lx", "ld19"]) -> None:
    late_s = arrivals_s(f"late-{model}", model, 0.02) - arrivals_s(f"early-{model}", model, 0.0)
    assert late_s.min() > -0.0011  # the host looks once per millisecond
    assert late_s.max() < 0.0211
    assert late_s.max() > 0.012
    assert late_s.std() > 0.002
