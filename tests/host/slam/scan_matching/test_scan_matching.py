"""The scan matcher and the distance field."""

import math

import numpy as np
import pytest
from benchmarks.shared.distances import distance_from_scratch
from benchmarks.shared.rooms import room_scan
from hypothesis import given, settings
from hypothesis import strategies as st

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.deskew import HIT, INVALID, MISS, ScanPoints, scan_points
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.scan_matching.correlative import SearchWindow, correlative_search
from thumper.slam.scan_matching.distance_field import DistanceField
from thumper.slam.scan_matching.gauss_newton import (
    MatchOptions,
    MatchWeights,
    NormalEquations,
    PosePrior,
    add_beams,
    interpolate,
    match,
    normal_equations,
    score,
)

TRUTH = Pose2(x_m=0.4, y_m=0.3, theta_rad=0.25)
NO_PRIOR = np.zeros((3, 3))
WEIGHTS = MatchWeights(MatchOptions().beam_std_m)
CLEARED_AFTER = 437  # scans


def room_grid() -> HitGrid:
    """Return the room, mapped from known poses."""
    grid = HitGrid(resolution_m=0.05, max_distance_m=0.5, occupied_fraction=0.25)
    for x_m, y_m in ((0.0, 0.0), (1.0, 0.8), (-1.0, 1.0), (2.0, -0.8)):
        pose = Pose2(x_m=x_m, y_m=y_m)
        grid.insert(pose, scan_points(room_scan(pose), Twist2(), Pose2(), 10.0))
    return grid


GRID = room_grid()
HITS_M = scan_points(room_scan(TRUTH), Twist2(), Pose2(), 10.0).hits_m


def to_corner(pose: Pose2) -> FloatArray:
    x_m, y_m = GRID.corner_m
    return np.array([pose.x_m - x_m, pose.y_m - y_m, pose.theta_rad])


def error(found: FloatArray) -> tuple[float, float]:
    off = found - to_corner(TRUTH)
    return math.hypot(off[0], off[1]), abs(off[2])


@given(dx=st.floats(-0.2, 0.2), dy=st.floats(-0.2, 0.2), turn=st.floats(-0.15, 0.15))
@settings(max_examples=60, deadline=None)
def test_gauss_newton_recovers_slip_without_a_prior(dx: float, dy: float, turn: float) -> None:
    start = to_corner(Pose2(x_m=TRUTH.x_m + dx, y_m=TRUTH.y_m + dy, theta_rad=TRUTH.theta_rad + turn))
    found = match(HITS_M, start, PosePrior(start, NO_PRIOR), GRID.field, WEIGHTS)
    off_m, off_rad = error(found)
    assert off_m < 0.02  # less than half a cell
    assert off_rad < 0.01


@given(dx=st.floats(-0.45, 0.45), dy=st.floats(-0.45, 0.45), turn=st.floats(-0.35, 0.35))
@settings(max_examples=15, deadline=None)
def test_window_search_brings_large_slip_into_the_basin(dx: float, dy: float, turn: float) -> None:
    start = to_corner(Pose2(x_m=TRUTH.x_m + dx, y_m=TRUTH.y_m + dy, theta_rad=TRUTH.theta_rad + turn))
    found = correlative_search(HITS_M, start, SearchWindow(0.5, 0.4, 0.1, 0.04), GRID.field, 0.2)
    off_m, off_rad = error(found)
    assert off_m < 0.15
    assert off_rad < 0.1


def test_prior_decides_along_a_bare_corridor() -> None:
    """Two parallel walls constrain y and heading; x must stay where odometry puts it."""
    corridor = np.array([[-20.0, -0.83, 20.0, -0.83], [-20.0, 0.83, 20.0, 0.83]])
    grid = HitGrid(resolution_m=0.05, max_distance_m=0.5, occupied_fraction=0.25)
    points = scan_points(room_scan(Pose2(), walls=corridor), Twist2(), Pose2(), 4.0)
    grid.insert(Pose2(), points)
    x_m, y_m = grid.corner_m
    predicted = np.array([0.3 - x_m, 0.1 - y_m, 0.05])
    found = match(
        points.hits_m[np.abs(points.hits_m[:, 0]) < 3.0],
        predicted,
        PosePrior(predicted, np.eye(3) / 0.05**2),
        grid.field,
        WEIGHTS,
    )
    assert found[0] == pytest.approx(predicted[0], abs=0.06)
    assert found[1] + y_m == pytest.approx(0.0, abs=0.02)
    assert found[2] == pytest.approx(0.0, abs=0.01)


@given(x=st.floats(-1.5, 2.5), y=st.floats(-1.0, 2.0), theta=st.floats(-3, 3))
@settings(deadline=None)
def test_gradient_is_the_slope_of_the_cost(x: float, y: float, theta: float) -> None:
    """Against one-sided differences, which differ only across the edge of a cell."""
    pose = to_corner(Pose2(x_m=x, y_m=y, theta_rad=theta))
    prior = PosePrior(pose + np.array([0.02, -0.03, 0.01]), np.diag([40.0, 50.0, 60.0]))
    weights = MatchWeights(0.05, 0.15)
    points_m = HITS_M[::60]

    def cost(at: FloatArray) -> tuple[float, FloatArray]:
        system = NormalEquations(np.zeros((3, 3)), np.zeros(3))
        value = normal_equations(points_m, at, prior, GRID.field, weights, system)
        return value, system.gradient

    _, gradient = cost(pose)
    step = 1e-7
    for k in range(3):
        ahead, behind = pose.copy(), pose.copy()
        ahead[k] += step
        behind[k] -= step
        forward = (cost(ahead)[0] - cost(pose)[0]) / step
        backward = (cost(pose)[0] - cost(behind)[0]) / step
        low, high = min(forward, backward), max(forward, backward)
        slack = 1e-3 * (1.0 + abs(low) + abs(high))
        assert low - slack <= gradient[k] <= high + slack


def test_costs_are_the_sums_over_all_beams() -> None:
    """So many that the product of their factors exceeds every number."""
    points_m, pose = np.concatenate([scale * HITS_M for scale in (0.7, 1.0, 1.2)]), to_corner(TRUTH)
    system = NormalEquations(np.zeros((3, 3)), np.zeros(3))
    cauchy, geman_mcclure = add_beams(points_m, pose, GRID.field, 0.05, 0.15, system)

    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    ends = (points_m @ np.array([[cos, sin], [-sin, cos]]) + pose[:2]) / GRID.resolution_m
    off_m = np.array([interpolate(GRID.field, x, y)[0] for x, y in ends])
    relative = (off_m / 0.15) ** 2
    assert np.log10(1.0 + relative).sum() > 308
    assert cauchy == pytest.approx(0.5 * (0.15 / 0.05) ** 2 * np.log(1.0 + relative).sum())
    assert geman_mcclure == pytest.approx((0.5 * (off_m / 0.05) ** 2 / (1.0 + relative)).sum())


def test_interpolation_is_exact_at_cell_centres() -> None:
    field = DistanceField(np.array([[0.0, 1.0], [2.0, 5.0]], dtype=np.float32), 1.0, 9.0)
    assert interpolate(field, 0.5, 0.5)[0] == 0.0
    assert interpolate(field, 1.0, 1.0)[0] == pytest.approx(2.0)
    assert interpolate(field, 0.4, 1.0) == (9.0, 0.0, 0.0)
    assert interpolate(field, 30.0, 1.0) == (9.0, 0.0, 0.0)


def test_match_in_patches_equals_that_in_one_array() -> None:
    """Distances are exact in both, so all digits of the poses are the same."""
    field = DistanceField(GRID.distance_m, GRID.resolution_m, GRID.max_distance_m)
    for turn_rad in (-0.1, 0.0, 0.15):
        start = to_corner(Pose2(x_m=TRUTH.x_m + 0.1, y_m=TRUTH.y_m, theta_rad=TRUTH.theta_rad + turn_rad))
        prior = PosePrior(start, NO_PRIOR)
        found = match(HITS_M, start, prior, GRID.field, WEIGHTS)
        np.testing.assert_array_equal(found, match(HITS_M, start, prior, field, WEIGHTS))
        assert score(HITS_M, found, GRID.field, 0.1) == score(HITS_M, found, field, 0.1)


@given(
    poses=st.lists(
        st.tuples(st.floats(-1.5, 1.5), st.floats(-0.5, 1.2), st.floats(-3, 3)), min_size=1, max_size=6
    )
)
@settings(max_examples=25, deadline=None)
def test_updated_distances_equal_distances_from_scratch(poses: list[tuple[float, float, float]]) -> None:
    """Wrong poses make hundreds of cells occupied and free again, and the array grows."""
    grid = HitGrid(resolution_m=0.1, max_distance_m=0.5, occupied_fraction=0.4)
    for x_m, y_m, theta_rad in poses:
        points = scan_points(room_scan(Pose2(), beams=90, step_rad=math.tau / 90), Twist2(), Pose2(), 10.0)
        grid.insert(Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad), points)
    np.testing.assert_array_equal(grid.distance_m, distance_from_scratch(grid))


def test_old_obstacle_is_cleared_in_bounded_time() -> None:
    grid = HitGrid(resolution_m=0.1, max_distance_m=0.5, occupied_fraction=0.25)
    beam = {"origins_m": np.zeros((1, 2)), "ends_m": np.array([[1.05, 0.05]])}
    for _ in range(3000):
        grid.insert(Pose2(), ScanPoints(**beam, kinds=np.array([HIT], dtype=np.uint8)))
    row, col = grid.grid(percent=False).cell_of(1.05, 0.05)
    assert grid.occupied()[row, col]
    assert grid.distance_m[row, col] == 0.0
    beam["ends_m"] = np.array([[2.05, 0.1]])
    scans = 0
    while grid.occupied().any() and scans < 3000:
        grid.insert(Pose2(), ScanPoints(**beam, kinds=np.array([MISS], dtype=np.uint8)))
        scans += 1
    assert 3 < scans <= CLEARED_AFTER
    np.testing.assert_array_equal(grid.distance_m, distance_from_scratch(grid))


def test_beams_are_classified() -> None:
    scan = room_scan(Pose2(), beams=6, first_rad=0.0, step_rad=math.tau / 6)
    ranges_m = np.array([1.0, np.nan, np.inf, 7.0, 0.001, 50.0])
    scan = type(scan)(
        time_s=0.0, ranges_m=ranges_m, angle_min_rad=0.0, angle_increment_rad=0.1, range_max_m=30.0
    )
    points = scan_points(scan, Twist2(), Pose2(x_m=0.2), 5.0)
    assert points.kinds.tolist() == [HIT, INVALID, MISS, MISS, INVALID, INVALID]
    assert points.ends_m[0] == pytest.approx([1.2, 0.0])
    assert np.hypot(*(points.ends_m[3] - points.origins_m[3])) == pytest.approx(5.0)


def test_deskew_keeps_a_wall_straight_for_a_turning_robot() -> None:
    """Each beam is cast from the robot's pose at that time; without de-skewing the wall would bend."""
    wall = np.array([[2.0, -9.0, 2.0, 9.0]])
    twist, increment_s = Twist2(v_m_s=1.0, w_rad_s=2.0), 1e-3
    mount = Pose2(x_m=0.1, y_m=-0.05, theta_rad=0.1)
    ranges = []
    for i in range(100):
        turn_rad = twist.w_rad_s * i * increment_s
        radius_m = twist.v_m_s / twist.w_rad_s
        base = Pose2(
            x_m=radius_m * math.sin(turn_rad), y_m=radius_m * (1 - math.cos(turn_rad)), theta_rad=turn_rad
        )
        one = room_scan(base @ mount, walls=wall, beams=1, first_rad=-0.5 + 0.01 * i)
        ranges.append(one.ranges_m[0])
    scan = type(one)(
        time_s=0.0,
        ranges_m=np.array(ranges),
        angle_min_rad=-0.5,
        angle_increment_rad=0.01,
        time_increment_s=increment_s,
        range_max_m=30.0,
    )
    assert scan_points(scan, twist, mount, 10.0).hits_m[:, 0] == pytest.approx(np.full(100, 2.0), abs=1e-9)
    assert np.ptp(scan_points(scan, Twist2(), mount, 10.0).hits_m[:, 0]) > 0.1
