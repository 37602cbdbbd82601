"""Footprint geometry, and the outline check against brute force on the same cells."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thumper.common.geometry import FloatArray, Pose2
from thumper.maps.distance_transform import squared_distances
from thumper.navigation.costmap.footprint_collision import (
    CollisionGrid,
    is_free,
    lethal_count,
    safe_squared_cells,
    touches_more,
)
from thumper.navigation.costmap.inflation import LETHAL
from thumper.navigation.footprint import Footprint
from thumper_hil.kinematic.maps import ROS_FOOTPRINT, read_pgm

CELL_M = 0.05


def test_radii_of_the_default_rectangle() -> None:
    footprint = Footprint()
    assert footprint.inscribed_radius_m == pytest.approx(0.15)
    assert footprint.circumscribed_radius_m == pytest.approx(math.hypot(0.21, 0.15))
    assert Footprint.rectangle(length_m=0.42, width_m=0.30) == footprint


def test_grown_moves_every_edge() -> None:
    assert Footprint().grown(0.03).polygon_m() == pytest.approx(
        Footprint.rectangle(length_m=0.48, width_m=0.36).polygon_m()
    )


@pytest.mark.parametrize(
    "vertices",
    [
        ((0.0, 0.0), (1.0, 0.0)),
        ((-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)),  # clockwise
        ((1.0, -1.0), (2.0, -1.0), (2.0, 1.0), (1.0, 1.0)),  # base_link outside
        ((-1.0, -1.0), (1.0, -1.0), (0.0, 0.5), (1.0, 1.0), (-1.0, 1.0)),  # not convex
    ],
)
def test_invalid_polygons_are_rejected(vertices: tuple[tuple[float, float], ...]) -> None:
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
    grid = CollisionGrid(
        costs=costs,
        squared_cells=squared,
        origin=np.zeros(2),
        resolution=CELL_M,
        outline=outline_m,
        safe_squared=safe,
    )
    count = lethal_count(grid, False, pose.x_m, pose.y_m, pose.theta_rad)
    assert is_free(grid, pose.x_m, pose.y_m, pose.theta_rad) is (count == 0)
    for limit in (0, 1, max(0, count - 1), max(0, count)):
        is_more = count < 0 or count > limit
        assert touches_more(grid, False, pose.x_m, pose.y_m, pose.theta_rad, limit) is is_more
    return count


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
    """It finds every cell that a millimetre-fine outline crosses by more than a sliver, and no other."""
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
def test_skipping_by_centre_distance_changes_nothing(
    seed: int, x_m: float, y_m: float, theta_rad: float
) -> None:
    costs = np.where(np.random.default_rng(seed).random((40, 40)) < 0.01, LETHAL, 0).astype(np.uint8)
    pose, footprint = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad), Footprint()
    outline_m = footprint.outline_m(0.005)
    safe = safe_squared_cells(footprint.circumscribed_radius_m, CELL_M)
    assert count_at(costs, pose, outline_m, safe) == count_at(costs, pose, outline_m, math.inf)


def test_off_the_map() -> None:
    costs = np.zeros((40, 40), np.uint8)
    outline_m = Footprint().outline_m(0.025)
    assert count_at(costs, Pose2(x_m=0.1, y_m=1.0), outline_m, math.inf) == -1
    assert count_at(costs, Pose2(x_m=-0.1, y_m=1.0), outline_m, 0.0) == -1


def ros_line(start: tuple[int, int], end: tuple[int, int]) -> list[tuple[int, int]]:
    """Return the cells (col, row) that ROS's LineIterator visits."""
    ahead, aside = (0, 1) if abs(end[0] - start[0]) >= abs(end[1] - start[1]) else (1, 0)
    steps, rise = abs(end[ahead] - start[ahead]), abs(end[aside] - start[aside])
    cell, rest, cells = list(start), steps // 2, [start]
    for _ in range(steps):
        rest += rise
        if rest >= steps:
            rest -= steps
            cell[aside] += 1 if end[aside] >= start[aside] else -1
        cell[ahead] += 1 if end[ahead] >= start[ahead] else -1
        cells.append((cell[0], cell[1]))
    return cells


def lengths_in_cells(pose: Pose2) -> dict[tuple[int, int], float]:
    """Return the length of the true outline in each (col, row) [m], to half a millimetre."""
    fine = np.floor(pose.apply(ROS_FOOTPRINT.outline_m(0.0005)) / CELL_M).astype(int)
    cells, counts = np.unique(fine, axis=0, return_counts=True)
    return {(int(col), int(row)): 0.0005 * n for (col, row), n in zip(cells, counts, strict=True)}


@pytest.mark.parametrize(("name", "count"), [("open", 11), ("median", 37), ("tight", 44)])
def test_differs_from_ros_only_where_ros_leaves_the_outline(nav_data: Path, name: str, count: int) -> None:
    """ROS checks integer lines between the corners' cells; Thumper samples the true outline each half cell.

    The test explains every one of 2000 poses on which they differ: a cell that the outline crosses and ROS's
    line does not, one that ROS's line takes and the outline does not cross, or a corner clipped by less than
    a sample's spacing.
    """
    costs = read_pgm(nav_data / "oracle" / f"costmap_{name}.pgm")
    rows = np.loadtxt(nav_data / "oracle" / f"footprint_{name}.csv", delimiter=",", skiprows=1)
    outline_m, polygon_m = ROS_FOOTPRINT.outline_m(0.5 * CELL_M), ROS_FOOTPRINT.polygon_m()
    differ = 0
    for x_m, y_m, theta_rad, ros_cost in rows:
        pose = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
        ours = count_at(costs, pose, outline_m, math.inf)
        corners = np.floor(pose.apply(polygon_m) / CELL_M).astype(int)
        is_off = bool((corners < 0).any() or (corners >= costs.shape[0]).any())
        if ours < 0 or ros_cost == -3.0:  # ROS stops at the first bad edge, be it off the map or blocked
            assert is_off
            assert ours == -1
            continue
        if ros_cost == -2.0:  # unknown space on the outline: ROS reports no more
            continue
        vertices = [(int(col), int(row)) for col, row in corners]
        walked = {cell for i in range(4) for cell in ros_line(vertices[i], vertices[i - 1])}
        ros_hits = {(col, row) for col, row in walked if costs[row, col] == LETHAL}
        assert bool(ros_hits) == (ros_cost == -1.0)  # so these are the cells that ROS checked
        if (ours > 0) == bool(ros_hits):
            continue
        differ += 1
        crossed = {cell: m for cell, m in lengths_in_cells(pose).items() if costs[cell[1], cell[0]] == LETHAL}
        if ours > 0:
            assert crossed  # ROS misses an obstacle there
        else:
            assert all(length_m < 0.5 * CELL_M for length_m in crossed.values())
    assert differ == count
