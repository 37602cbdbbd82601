"""One outline of the robot: the simulator's body and the default footprint of navigation are the same."""

import math

import numpy as np
import pytest

from thumper.config.robot import RobotConfig
from thumper.navigation.footprint import Footprint
from thumper_hil.bench.collision import FOOTPRINT_M
from thumper_hil.chip.robot_params import RobotParams

WHEEL_TRACK_M = 0.245  # between the middles of the tyres
TYRE_WIDTHS_M = (0.05, 0.06)  # the 120 mm tyres of the Wild Thumper


def sorted_corners(polygon_m: np.typing.NDArray[np.float64]) -> list[tuple[float, float]]:
    return sorted((float(x_m), float(y_m)) for x_m, y_m in polygon_m)


def test_navigation_plans_for_the_simulated_outline() -> None:
    assert sorted_corners(RobotConfig().footprint.polygon_m()) == sorted_corners(FOOTPRINT_M)
    assert sorted_corners(Footprint().polygon_m()) == sorted_corners(FOOTPRINT_M)


def test_the_tyres_are_inside_the_outline() -> None:
    """The track is measured between the middles of the tyres, so the outline is one tyre wider."""
    narrowest_m, widest_m = TYRE_WIDTHS_M
    assert narrowest_m <= 2.0 * Footprint().inscribed_radius_m - WHEEL_TRACK_M <= widest_m


def test_yaw_inertia_is_that_of_a_box_of_this_outline() -> None:
    params = RobotParams.load()
    diagonal_m = math.hypot(params.outline.length_m, params.outline.width_m)
    assert params.body.yaw_inertia_kg_m2 == pytest.approx(params.body.mass_kg * diagonal_m**2 / 12, rel=0.01)
