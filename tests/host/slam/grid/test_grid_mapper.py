"""`GridMapper` end to end in synthetic rooms."""

import math

import numpy as np
import pytest
from benchmarks.shared.rooms import room_scan

from tests.variants import some_of
from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.lidar.scan import Scan
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.grid.kidnap_detector import KidnapDetector
from thumper.slam.grid.options import GridMapperOptions
from thumper.slam.grid.slide_detector import SlideDetector
from thumper.slam.mapper import Mapper

STILL = Twist2()


def tour(steps: int = 40) -> list[Pose2]:
    """Return a closed path around the middle of the room."""
    angles = np.linspace(0.0, math.tau, steps)
    return [
        Pose2(
            x_m=0.3 + 0.9 * math.sin(a),
            y_m=0.4 - 0.6 * math.cos(a),
            theta_rad=wrap_angle(math.atan2(0.6 * math.sin(a), 0.9 * math.cos(a))),
        )
        for a in angles
    ]


def driven(mapper: Mapper, mount: Pose2, clockwise: bool = False, slip: float = 0.0) -> list[Pose2]:
    """Drive the tour with odometry that reads too large by the share `slip`; return the mapper's poses."""
    path, odometry, found = tour(), Pose2(), []
    rng = np.random.default_rng(1)
    for before, pose in zip([path[0], *path[:-1]], path, strict=True):
        step = before.inverse() @ pose
        odometry = odometry @ Pose2(
            x_m=(1 + slip) * step.x_m, y_m=step.y_m, theta_rad=(1 + slip) * step.theta_rad
        )
        first_rad, step_rad = (math.pi, -math.tau / 360) if clockwise else (-math.pi, math.tau / 360)
        scan = room_scan(pose @ mount, first_rad=first_rad, step_rad=step_rad, noise_m=0.01, rng=rng)
        found.append(mapper.update(odometry, scan, STILL).map_from_base)
    return found


def driven_any(mapper: Mapper, slip: float) -> list[Pose2]:
    """Drive the tour with the lidar at the robot's centre, with any mapper."""
    return driven(mapper, Pose2(), slip=slip)


def worst_m(found: list[Pose2]) -> float:
    return max(pose.distance_m(truth) for pose, truth in zip(found, tour(), strict=True))


def share_equal(one: OccupancyGrid, other: OccupancyGrid) -> float:
    """Return the share of one grid's occupied cells with one of the other grid within one cell."""
    hits = 0
    cells = np.argwhere(one.cells == OCCUPIED)
    for row, col in cells:
        r, c = other.cell_of(*one.centre_of(int(row), int(col)))
        hits += bool((other.cells[max(0, r - 1) : r + 2, max(0, c - 1) : c + 2] == OCCUPIED).any())
    return hits / len(cells)


def test_tour_is_followed_with_twenty_percent_slip() -> None:
    mapper = GridMapper(map_from_base=tour()[0])
    found = driven(mapper, Pose2(), slip=0.2)
    assert worst_m(found) < 0.03
    # The correction is what odometry got wrong: a fifth of the full turn, 72 degrees.
    assert mapper.map_from_odom.theta_rad + 0.2 * math.tau == pytest.approx(tour()[0].theta_rad, abs=0.03)


def test_map_has_walls_and_free_space_in_the_right_places() -> None:
    mapper = GridMapper(map_from_base=tour()[0])
    driven(mapper, Pose2())
    grid = mapper.grid()
    for x_m, y_m in ((-2.0, 0.5), (3.0, 0.5), (0.5, -1.5), (0.5, 2.5), (1.8, 2.0), (-1.0, -0.6)):
        row, col = grid.cell_of(x_m, y_m)
        assert (grid.cells[row - 1 : row + 2, col - 1 : col + 2] == OCCUPIED).any(), (x_m, y_m)
    for x_m, y_m in ((0.0, 0.0), (1.0, 1.0), (2.5, 0.0), (-1.7, 2.2)):
        assert grid.cells[grid.cell_of(x_m, y_m)] == FREE, (x_m, y_m)
    assert grid.cells[grid.cell_of(2.4, 2.05)] == UNKNOWN  # inside the cupboard
    percent = mapper.grid_percent()
    assert ((percent.cells >= 25) == (grid.cells == OCCUPIED)).mean() > 0.999
    assert ((percent.cells == UNKNOWN) == (grid.cells == UNKNOWN)).all()


@pytest.mark.parametrize(
    ("mount", "clockwise"),
    some_of(
        [
            (Pose2(x_m=0.1, y_m=-0.05, theta_rad=0.7), True),
            (Pose2(x_m=-0.1, y_m=0.08, theta_rad=math.pi), False),
            (Pose2(x_m=0.12), False),
            (Pose2(), True),
        ],
        fast=2,
    ),
)
def test_any_lidar_mount_and_direction_gives_the_same_map(mount: Pose2, clockwise: bool) -> None:
    plain = GridMapper(map_from_base=tour()[0])
    driven(plain, Pose2())
    other = GridMapper(base_from_laser=mount, map_from_base=tour()[0])
    found = driven(other, mount, clockwise)
    assert worst_m(found) < 0.05  # a cell
    assert share_equal(other.grid(), plain.grid()) > 0.95
    assert share_equal(plain.grid(), other.grid()) > 0.95


def test_stationary_robot_neither_drifts_nor_changes_the_map() -> None:
    mapper, rng = GridMapper(), np.random.default_rng(2)
    mapper.update(Pose2(), room_scan(Pose2(), noise_m=0.02, rng=rng), STILL)
    before = mapper.grid()
    poses = []
    for _ in range(60):
        update = mapper.update(Pose2(), room_scan(Pose2(), noise_m=0.02, rng=rng), STILL)
        assert not update.integrated
        poses.append(update.map_from_base)
    np.testing.assert_array_equal(mapper.grid().cells, before.cells)
    assert max(pose.distance_m(Pose2()) for pose in poses) < 0.02
    ends = [np.mean([(p.x_m, p.y_m) for p in part], axis=0) for part in (poses[:20], poses[-20:])]
    assert np.hypot(*(ends[1] - ends[0])) < 0.004  # noise, but no trend


def test_pushed_robot_is_followed() -> None:
    """Odometry reports no motion. Beyond Gauss-Newton's basin the window search finds the pose."""
    mapper = GridMapper()
    mapper.update(Pose2(), room_scan(Pose2()), STILL)
    pushed = Pose2(x_m=0.35, y_m=-0.3, theta_rad=0.3)
    for _ in range(3):
        update = mapper.update(Pose2(), room_scan(pushed), STILL)
    assert update.map_from_base.distance_m(pushed) < 0.03
    assert update.match_score > 0.8


def full_circle(range_m: float) -> Scan:
    return Scan(
        time_s=0.0,
        ranges_m=np.concatenate((np.full(36, 1.0), np.full(36, range_m))),
        angle_min_rad=0.0,
        angle_increment_rad=math.tau / 72,
    )


@pytest.mark.parametrize(
    ("range_m", "cell", "where_m"),
    [
        (math.nan, UNKNOWN, 2.0),  # invalid: no-return is not free space
        (0.0, UNKNOWN, 2.0),
        (math.inf, FREE, 2.0),  # free ...
        (math.inf, UNKNOWN, 4.5),  # ... up to the usable range
        (5.0, FREE, 2.0),  # beyond the usable range: clears, marks nothing
        (5.0, UNKNOWN, 5.0),
        (3.0, OCCUPIED, 3.0),
    ],
)
def test_effect_of_a_beam_on_a_cell(range_m: float, cell: int, where_m: float) -> None:
    mapper = GridMapper(GridMapperOptions(usable_range_m=4.0))
    mapper.update(Pose2(), full_circle(range_m), STILL)
    grid = mapper.grid()
    bearing_rad = math.radians(250.0)  # a beam in the second half of the scan
    row, col = grid.cell_of(where_m * math.cos(bearing_rad), where_m * math.sin(bearing_rad))
    assert (grid.cells[row, col] if grid.contains(row, col) else UNKNOWN) == cell


@pytest.mark.parametrize(("range_m", "angle_min_rad"), [(math.nan, 0.0), (1.0, math.nan), (1.0, math.inf)])
def test_invalid_scan_moves_the_pose_by_odometry_alone(range_m: float, angle_min_rad: float) -> None:
    mapper = GridMapper()
    mapper.update(Pose2(), room_scan(Pose2()), STILL)
    before = mapper.grid()
    blind = Scan(
        time_s=0.0,
        ranges_m=np.full(500, range_m),
        angle_min_rad=angle_min_rad,
        angle_increment_rad=math.tau / 500,
    )
    update = mapper.update(Pose2(x_m=0.4, theta_rad=0.2), blind, STILL)
    assert update.map_from_base == Pose2(x_m=0.4, theta_rad=0.2)
    assert math.isnan(update.match_score)
    np.testing.assert_array_equal(mapper.grid().cells, before.cells)


def test_obstacle_that_moved_away_is_cleared() -> None:
    room = room_scan(Pose2())
    blocked = room.ranges_m.copy()
    blocked[80:100] = 0.8
    person = Scan(
        time_s=0.0,
        ranges_m=blocked,
        angle_min_rad=-math.pi,
        angle_increment_rad=math.tau / 360,
        range_max_m=30.0,
    )
    mapper = GridMapper()
    mapper.update(Pose2(), person, STILL)
    grid = mapper.grid()
    cell = grid.cell_of(0.0, -0.8)
    assert (grid.cells[cell[0] - 1 : cell[0] + 2, cell[1]] == OCCUPIED).any()
    for step in range(1, 8):
        pose = Pose2(x_m=0.12 * step)
        mapper.update(pose, room_scan(pose), STILL)
    grid = mapper.grid()
    row, col = grid.cell_of(0.0, -0.8)
    assert (grid.cells[row - 1 : row + 2, col] == FREE).all()


@pytest.mark.parametrize("suspect", [False, True])
def test_rejected_match_counts_as_odometry_for_the_slide(
    monkeypatch: pytest.MonkeyPatch, suspect: bool
) -> None:
    """The pose follows odometry then, so it does not slide."""
    monkeypatch.setattr(KidnapDetector, "suspect", property(lambda _: suspect))
    apart_m = list[float]()

    def noted(_: SlideDetector, hits_m: FloatArray, moved: Pose2, matched: Pose2, heading_rad: float) -> None:
        apart_m.append(moved.distance_m(matched))

    monkeypatch.setattr(SlideDetector, "update", noted)
    driven(GridMapper(), Pose2(), slip=0.2)
    assert (max(apart_m) < 1e-9) == suspect
