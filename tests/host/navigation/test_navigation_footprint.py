"""Footprint geometry and the outline check against a brute-force reading of the same cells."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thumper.geometry import FloatArray, Pose2
from thumper.navigation.footprint import Footprint
from thumper.navigation.footprint_check import lethal_count, safe_squared_cells
from thumper.navigation.inflation import LETHAL, squared_distances
from thumper_hil.arena.maps import read_pgm

CELL_M = 0.05


def test_radii_of_the_default_rectangle() -> None:
    footprint = Footprint()
    assert footprint.inscribed_radius_m == pytest.approx(0.1225)
    assert footprint.circumscribed_radius_m == pytest.approx(math.hypot(0.21, 0.1225))
    assert Footprint.rectangle(length_m=0.42, width_m=0.245) == footprint


def test_growing_moves_every_edge() -> None:
    assert Footprint().grown(0.03).polygon_m() == pytest.approx(
        Footprint.rectangle(length_m=0.48, width_m=0.305).polygon_m()
    )


@pytest.mark.parametrize(
    "vertices",
    [
        ((0.0, 0.0), (1.0, 0.0)),
        ((-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)),  # clockwise
        ((1.0, -1.0), (2.0, -1.0), (2.0, 1.0), (1.0, 1.0)),  # base_link outside
        ((-1.0, -1.0), (1.0, -1.0), (0.0, 0.5), (1.0, 1.0), (-1.0, 1.0)),  # dented
    ],
)
def test_senseless_polygons_are_refused(vertices: tuple[tuple[float, float], ...]) -> None:
    with pytest.raises(ValueError, match="footprint"):
        Footprint(vertices_m=vertices)


def test_outline_is_dense_and_on_the_edges() -> None:
    outline = Footprint().outline_m(0.025)
    gaps = np.hypot(*(np.roll(outline, -1, axis=0) - outline).T)
    planes = Footprint().half_planes()
    depth = (planes[:, 2] - outline @ planes[:, :2].T).min(axis=1)
    assert gaps.max() <= 0.025 + 1e-12
    assert np.abs(depth).max() < 1e-12


def count_at(costs: np.typing.NDArray[np.uint8], pose: Pose2, outline_m: FloatArray, safe: float) -> int:
    squared = squared_distances(costs == LETHAL, 8)
    origin = np.zeros(2)
    return lethal_count(
        costs, squared, origin, CELL_M, outline_m, safe, False, pose.x_m, pose.y_m, pose.theta_rad
    )


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    x_m=st.floats(0.4, 1.6),
    y_m=st.floats(0.4, 1.6),
    theta_rad=st.floats(-math.pi, math.pi),
)
def test_check_equals_brute_force_on_a_fine_outline(
    seed: int, x_m: float, y_m: float, theta_rad: float
) -> None:
    """Every cell that a millimetre-fine outline crosses by more than a sliver is found, and no other."""
    costs = np.where(np.random.default_rng(seed).random((40, 40)) < 0.04, LETHAL, 0).astype(np.uint8)
    pose = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
    footprint = Footprint()
    fine = pose.apply(footprint.outline_m(0.001))
    cells = np.floor(fine / CELL_M).astype(int)
    on_obstacle = costs[cells[:, 1], cells[:, 0]] == LETHAL
    outline_m = footprint.outline_m(0.5 * CELL_M)
    found = count_at(costs, pose, outline_m, safe_squared_cells(footprint.circumscribed_radius_m, CELL_M))
    if found > 0:
        assert on_obstacle.any()
    if found == 0:  # only clipped corners, shorter than the spacing of the samples, may be missed
        assert on_obstacle.sum() * 0.001 <= 2 * 0.5 * CELL_M


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000), x_m=st.floats(0.4, 1.6), y_m=st.floats(0.4, 1.6), theta_rad=st.floats(-3, 3)
)
def test_the_short_cut_by_centre_distance_changes_nothing(
    seed: int, x_m: float, y_m: float, theta_rad: float
) -> None:
    costs = np.where(np.random.default_rng(seed).random((40, 40)) < 0.01, LETHAL, 0).astype(np.uint8)
    pose, footprint = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad), Footprint()
    outline_m = footprint.outline_m(0.005)
    safe = safe_squared_cells(footprint.circumscribed_radius_m, CELL_M)
    assert count_at(costs, pose, outline_m, safe) == count_at(costs, pose, outline_m, math.inf)


def test_off_the_map_is_told() -> None:
    costs = np.zeros((40, 40), np.uint8)
    outline_m = Footprint().outline_m(0.025)
    assert count_at(costs, Pose2(x_m=0.1, y_m=1.0), outline_m, math.inf) == -1
    assert count_at(costs, Pose2(x_m=-0.1, y_m=1.0), outline_m, 0.0) == -1


@pytest.mark.parametrize("name", ["open", "median", "tight"])
def test_agrees_with_ros_footprint_cost(nav_data: Path, name: str) -> None:
    """ROS walks integer lines, ours samples the true outline: they may part on clipped corners alone."""
    costs = read_pgm(nav_data / "oracle" / f"costmap_{name}.pgm")
    rows = np.loadtxt(nav_data / "oracle" / f"footprint_{name}.csv", delimiter=",", skiprows=1)
    outline_m = Footprint().outline_m(0.5 * CELL_M)
    ours = np.array(
        [count_at(costs, Pose2(x_m=x, y_m=y, theta_rad=t), outline_m, math.inf) for x, y, t, _ in rows]
    )
    assert ((ours == -1) == (rows[:, 3] == -3)).mean() > 0.99
    comparable = (rows[:, 3] > -2) & (ours >= 0)
    assert comparable.sum() > 500
    agree = (ours[comparable] > 0) == (rows[comparable, 3] == -1)
    assert agree.mean() > 0.95
