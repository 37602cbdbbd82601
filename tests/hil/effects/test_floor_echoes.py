"""Floor echoes: a lowered beam on a level floor, beams before, on and beside a ramp, and many ramps."""

import math

import numpy as np
import pytest

from thumper.common.geometry import FloatArray
from thumper_hil.effects.floor_echoes import NO_RAMPS, floor_range_m, slope_toward

HEIGHT_M = 0.2
RAMP = np.array([[3.0, 0.0, 2.0, 1.0, 0.0, 0.4]])  # from x = 2 to 4, by 0.2 per metre


def ranges_m(rays: list[tuple[float, float, float]], down: float, ramps_m: FloatArray = RAMP) -> FloatArray:
    """Return where rays x, y, angle [deg] meet the floor."""
    array = np.array(rays) * (1.0, 1.0, math.pi / 180.0)
    return floor_range_m(array, np.full(len(rays), down), HEIGHT_M, ramps_m)


def test_three_degrees_see_a_level_floor_at_3_8_metres() -> None:
    down = math.tan(math.radians(3.0)) * np.cos(np.radians([0.0, 60.0, 120.0]))
    found_m = floor_range_m(np.zeros((3, 3)), down, HEIGHT_M, NO_RAMPS)
    assert found_m[:2] == pytest.approx([3.8, 7.6], abs=0.05)
    assert found_m[2] == math.inf


def test_a_level_beam_ends_on_a_ramp_that_rises_to_its_height() -> None:
    assert ranges_m([(0.0, 0.0, 0.0)], 0.0) == pytest.approx([2.0 + HEIGHT_M / 0.2])
    assert ranges_m([(0.0, 0.0, 0.0)], 0.05) == pytest.approx([2.0 + 0.1 / 0.25])
    assert ranges_m([(0.0, 0.6, 0.0), (0.0, 0.0, 180.0)], 0.0).tolist() == [math.inf, math.inf]
    assert ranges_m([(6.0, 0.0, 180.0)], 0.0).tolist() == [math.inf]  # the floor falls away below it


def test_a_beam_along_the_ramp_meets_the_level_floor_beyond_it() -> None:
    on_it = [(3.0, 0.0, 180.0)]
    assert ranges_m(on_it, 0.2) == pytest.approx([1.0 + HEIGHT_M / 0.2])  # the front is down
    assert ranges_m(on_it, 0.3) == pytest.approx([1.0 + 0.1 / 0.3])
    assert ranges_m([(3.0, 0.0, 0.0)], -0.2).tolist() == [math.inf]


def test_the_slope_depends_on_the_direction() -> None:
    points_m, angles_rad = np.array([[3.0, 0.4]] * 3 + [[3.0, 0.6]]), np.radians([0.0, 180.0, 90.0, 0.0])
    assert slope_toward(points_m, angles_rad, RAMP) == pytest.approx([0.2, -0.2, 0.0, 0.0], abs=1e-9)


def test_ranges_equal_those_of_small_steps() -> None:
    rng = np.random.default_rng(1)
    middles_m, sizes_m = rng.uniform(-3.0, 3.0, (4, 2)), rng.uniform(1.0, 3.0, (4, 2))
    ramps_m = np.column_stack((middles_m, sizes_m, rng.uniform(0.0, 360.0, 4), rng.uniform(0.05, 0.3, 4)))
    rays = np.column_stack((rng.uniform(-3, 3, (200, 2)), rng.uniform(0.0, math.tau, 200)))
    down = rng.uniform(-0.1, 0.1, 200)
    step_m, ahead = 0.002, np.column_stack((np.cos(rays[:, 2]), np.sin(rays[:, 2])))
    height_m, expected_m = np.full(200, HEIGHT_M), np.full(200, np.inf)
    for k in range(2500):
        middle_m = rays[:, :2] + (k + 0.5) * step_m * ahead
        height_m -= step_m * (down + slope_toward(middle_m, rays[:, 2], ramps_m))
        expected_m = np.where(np.isinf(expected_m) & (height_m <= 0.0), (k + 1) * step_m, expected_m)
    found_m = floor_range_m(rays, down, HEIGHT_M, ramps_m)
    seen = expected_m < 4.9
    assert seen.sum() > 50
    assert found_m[seen] == pytest.approx(expected_m[seen], abs=0.08)
    assert (found_m[~seen] > 4.8).all()
