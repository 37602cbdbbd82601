"""Scan averaging: less noise on what many beams hit, and nothing lost that one beam hits."""

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.costmap.scan_averaging import average_ranges, averaged_hits, confirmed_hits
from thumper_hil.kinematic.world import KinematicWorld, box

ANGLES_RAD = np.radians(np.arange(-120.0, 121.0))
POST = KinematicWorld(circles_m=np.array(((0.25, 0.0, 0.034),)))
NOISE_M = 0.01


def seen(world: KinematicWorld) -> tuple[FloatArray, FloatArray]:
    """Return beam angles and exact ranges of the lidar's hits."""
    ranges_m = world.cast(Pose2(), ANGLES_RAD, 4.0)
    hit = np.isfinite(ranges_m)
    return ANGLES_RAD[hit], ranges_m[hit]


def test_near_post_keeps_its_thickness() -> None:
    """Its nearest noisy point is 17 mm in front of it as measured, and 8 mm when averaged."""
    bearings_rad, exact_m = seen(POST)
    rng = np.random.default_rng(1)
    raw_m, mean_m = [], []
    for _ in range(100):
        noisy_m = exact_m + NOISE_M * rng.standard_normal(exact_m.size)
        raw_m.append((exact_m - noisy_m).max())
        mean_m.append((exact_m - average_ranges(bearings_rad, noisy_m)).max())
    assert np.mean(raw_m) == pytest.approx(0.017, abs=0.002)
    assert np.mean(mean_m) == pytest.approx(0.008, abs=0.002)


@pytest.mark.parametrize(
    "world",
    [
        POST,
        KinematicWorld.from_boxes(box(0.6, 0.0, 0.4, 3.0, yaw_rad=0.5)),
        KinematicWorld.from_boxes(box(0.0, 0.0, 2.0, 1.0)),
    ],
)
def test_exact_ranges_do_not_change(world: KinematicWorld) -> None:
    """Posts, slanted walls and corners stay within 2 mm."""
    bearings_rad, exact_m = seen(world)
    assert exact_m.size > 10
    assert average_ranges(bearings_rad, exact_m) == pytest.approx(exact_m, abs=0.002)


def test_single_hit_stays() -> None:
    """A wire 5 cm in front of a wall, and a post with nothing behind it."""
    ranges_m = np.full(21, 0.5)
    ranges_m[10] = 0.45
    assert average_ranges(np.radians(np.arange(21.0)), ranges_m)[10] == 0.45
    alone = average_ranges(np.radians((0.0, 20.0, 40.0)), np.array((1.0, 0.3, 1.0)))
    assert alone == pytest.approx((1.0, 0.3, 1.0))


def test_hits_move_only_along_their_beams() -> None:
    view, pose = FieldOfView(), Pose2(x_m=1.0, y_m=-2.0, theta_rad=0.7)
    bearings_rad, ranges_m = seen(POST)
    laser = pose @ view.base_from_laser
    noisy_m = ranges_m + NOISE_M * np.random.default_rng(2).standard_normal(ranges_m.size)
    points_m = laser.apply(np.column_stack((noisy_m * np.cos(bearings_rad), noisy_m * np.sin(bearings_rad))))
    after_rad, after_m = view.bearings_and_ranges(pose, averaged_hits(pose, points_m, view))
    assert after_rad == pytest.approx(bearings_rad)
    assert after_m == pytest.approx(average_ranges(bearings_rad, noisy_m))
    assert averaged_hits(pose, np.empty((0, 2)), view).shape == (0, 2)


def test_a_hit_alone_is_not_confirmed() -> None:
    """A mixed pixel between a chair leg and the wall behind it."""
    leg_m, air_m = [(1.0, 0.00), (1.0, 0.01)], [(1.6, 0.03)]
    wall_m = [(2.5, 0.05), (2.5, 0.07), (2.5, 0.09)]
    assert confirmed_hits(np.array(leg_m + air_m + wall_m)).tolist() == [True, True, False, True, True, True]
    assert confirmed_hits(np.array(air_m)).tolist() == [False]
    assert confirmed_hits(np.empty((0, 2))).tolist() == []
