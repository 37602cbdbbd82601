"""Tables, sills and surfaces in a world file: legs are seen, tops and sills are not."""

import math
from pathlib import Path

import numpy as np
import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper_hil.bench.collision import FOOTPRINT_M
from thumper_hil.effects.surfaces import Surface
from thumper_hil.world.gait import STEP_M, legs_m
from thumper_hil.world.world import World

TABLE = "[[table]]\nx_m = 2.0\ny_m = 0.0\nlength_m = 1.2\nwidth_m = 0.8\n"


def load(folder: Path, text: str) -> World:
    path = folder / "world.toml"
    path.write_text(text)
    return World.load(path)


def test_the_lidar_sees_the_legs_of_a_table_and_the_robot_passes_below(tmp_path: Path) -> None:
    world = load(tmp_path, TABLE)
    assert len(world.circles_m) == 4
    assert world.cast(0.0, 0.0, 0.0)[0] == math.inf
    assert world.cast(0.0, 0.38, 0.0)[0] == pytest.approx(1.4, abs=0.001)
    assert not world.touches(Pose2(x_m=2.0), FOOTPRINT_M)


def test_a_low_top_stops_the_robot_and_stays_unseen(tmp_path: Path) -> None:
    world = load(tmp_path, TABLE + "clearance_m = 0.15\n")
    assert world.cast(0.0, 0.0, 0.0)[0] == math.inf
    assert world.touches(Pose2(x_m=1.3), FOOTPRINT_M)
    assert not world.touches(Pose2(x_m=1.1), FOOTPRINT_M)


def test_a_file_names_surfaces_and_sills(tmp_path: Path) -> None:
    world = load(
        tmp_path,
        '[[wall]]\npoints_m = [[0, 0], [1, 0], [2, 0]]\nsurface = "glass"\n'
        '[[box]]\nx_m = 5\ny_m = 5\nlength_m = 1\nwidth_m = 1\nsurface = "dark"\n'
        "[[sill]]\npoints_m = [[3, 0], [3, 1]]\nheight_m = 0.02\n",
    )
    assert world.segment_surfaces.tolist() == [Surface.GLASS] * 2 + [Surface.DARK] * 4
    assert world.sills_m.tolist() == [[3.0, 0.0, 3.0, 1.0, 0.02]]
    with pytest.raises(ThumperError, match=r"wall\[0\].surface = 'wood': choose from matt, dark"):
        load(tmp_path, '[[wall]]\npoints_m = [[0, 0], [1, 0]]\nsurface = "wood"\n')


def test_legs_step_in_turn_one_rests_while_the_other_swings() -> None:
    walked_m = np.arange(0.0, 4.0 * STEP_M, 0.01)
    feet = np.array([legs_m((walked, 0.0), 0.0, walked, 0.06) for walked in walked_m])
    steps_m = np.diff(feet[:, :, 0], axis=0)
    resting, swinging = np.sort(steps_m, axis=1).T
    assert np.abs(resting).max() < 0.011
    assert np.median(resting) == pytest.approx(0.0, abs=1e-9)
    assert np.median(swinging) == pytest.approx(0.02)
    assert np.ptp(feet[:, :, 0].mean(axis=1) - walked_m) < 1e-9


@pytest.mark.parametrize("returns", ["true", "false"])
def test_people_with_legs_walk_into_the_robot_and_turn_back(returns: str, tmp_path: Path) -> None:
    from thumper_hil.world.scene import Scene

    walker = "[[person]]\nwaypoints_m = [[-3, 0], [3, 0]]\nleg_radius_m = 0.06\nspeed_m_s = 1.0\n"
    scene = Scene(load(tmp_path, f"{walker}returns = {returns}\n"))
    legs_m = []
    for tick in range(500):
        scene.step(0.01 * tick, 0.01, FOOTPRINT_M)
        legs_m.append(scene.world.legs_m)
    x_m = np.array(legs_m)[:, :, 0]
    half_length_m = FOOTPRINT_M[:, 0].max()
    assert -half_length_m - 0.06 <= x_m.max() < -half_length_m - 0.04  # its step into the robot
    assert x_m[-1].mean() < -2.0
    swapped = np.array([legs[::-1] for legs in legs_m])
    steps_m = np.abs(np.diff(legs_m, axis=0)).max(axis=(1, 2))
    steps_m = np.minimum(steps_m, np.abs(swapped[1:] - legs_m[:-1]).max(axis=(1, 2)))
    assert steps_m.max() < 0.021  # no leg jumps: the two are swapped at a turn
    assert scene.touches_by_people == 0  # the bench counts it


def test_a_person_who_does_not_return_stays_at_the_end_in_step(tmp_path: Path) -> None:
    from thumper_hil.world.scene import Scene

    once = (
        "[[person]]\nwaypoints_m = [[1, 0], [1, 2]]\nleg_radius_m = 0.06\nspeed_m_s = 1.0\nreturns = false\n"
    )
    scene = Scene(load(tmp_path, once))
    legs_m = []
    for tick in range(400):
        scene.step(0.01 * tick, 0.01, FOOTPRINT_M)
        legs_m.append(scene.world.legs_m)
    assert np.allclose(legs_m[-1][:, :2].mean(axis=0), (1.0, 2.0))
    assert np.abs(np.diff(legs_m, axis=0)).max() < 0.021  # no leg jumps, at the end neither


def test_whether_a_person_returns_is_true_or_false(tmp_path: Path) -> None:
    with pytest.raises(ThumperError, match=r"person\[0\]\.returns = 1: must be true or false"):
        load(tmp_path, "[[person]]\nwaypoints_m = [[1, 0], [1, 2]]\nreturns = 1\n")
