"""The search of a large map goes on over several scans: bounded work at each, and the same pose."""

import math

import numpy as np
import pytest
from benchmarks.shared.rooms import ROOM, room_scan

from tests.host.slam.localization.test_challenge import drive, proven
from thumper.common.geometry import Pose2, Twist2
from thumper.common.resumable import BAND_CELLS
from thumper.lidar.deskew import scan_points
from thumper.maps.distance_transform import squared_distances
from thumper.slam.grid.branch_and_bound import BranchAndBoundSearch
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.localization import likelihood_field
from thumper.slam.localization.amcl import Amcl
from thumper.slam.mode_switch import BANDS_PER_SCAN, SlamModeSwitch
from thumper_hil.world.world import World

GRID = World(segments_m=ROOM, circles_m=np.zeros((0, 3))).to_grid()
LOOKUPS = 600_000  # the search of the room needs 3 million


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[int | None]:
    """Make the room a large map; return the budgets of all parts of searches."""
    budgets: list[int | None] = []
    original = BranchAndBoundSearch.run

    def noted(search: BranchAndBoundSearch, max_lookups: int | None) -> bool:
        budgets.append(max_lookups)
        return original(search, max_lookups)

    monkeypatch.setattr(BranchAndBoundSearch, "run", noted)
    monkeypatch.setattr(likelihood_field, "LOOKUPS_PER_SLICE", LOOKUPS)
    return budgets


def step(robot: Amcl, odometry: Pose2, true: Pose2, seed: int) -> float:
    """Process a scan; return the error of the pose [m]."""
    scan = room_scan(true, noise_m=0.01, rng=np.random.default_rng(seed))
    return robot.update(odometry, scan, Twist2()).map_from_base.distance_m(true)


def test_a_search_does_one_part_of_bounded_size_at_each_scan(runs: list[int | None]) -> None:
    """Meanwhile the robot is lost, and it may turn."""
    robot, start = Amcl(GRID), Pose2(x_m=1.0, y_m=0.5, theta_rad=0.3)
    for k in range(40):
        moved = Pose2(x_m=0.02 * k, theta_rad=0.04 * k)
        before = len(runs)
        error_m = step(robot, moved, start @ moved, k)
        assert len(runs) - before <= 1
        if robot.relocalizations == 0:
            assert robot.quality().lost
    assert len(runs) >= 5
    assert set(runs) == {LOOKUPS}
    assert error_m < 0.05


def test_a_given_pose_follows_the_odometry_while_the_map_is_searched(runs: list[int | None]) -> None:
    start = Pose2(x_m=1.0, y_m=0.5, theta_rad=0.3)
    robot, lost = Amcl(GRID, map_from_base=start, odom_from_base=Pose2()), []
    for k in range(20):
        moved = Pose2(x_m=0.04 * k, theta_rad=0.03 * k)
        assert step(robot, moved, start @ moved, k) < 0.05
        lost.append(bool(robot.quality().lost))
    assert len(runs) >= 5
    assert lost == sorted(lost, reverse=True)  # not confirmed at first, then for good
    assert lost[0]
    assert not lost[-1]
    assert robot.relocalizations == 0


def test_a_carried_robot_finds_itself_after_several_scans(
    runs: list[int | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as given:
        given.setattr(likelihood_field, "LOOKUPS_PER_SLICE", 2**60)  # its given pose is confirmed at once
        robot, odometry, _ = proven()
    runs.clear()
    elsewhere = Pose2(x_m=2.3, y_m=-0.9, theta_rad=2.5)
    path = [elsewhere @ Pose2(x_m=0.12 * min(k, 4)) for k in range(60)]
    _, errors, lost = drive(robot, path, odometry, ROOM)
    assert len(runs) >= 8
    assert set(runs) == {LOOKUPS}
    assert lost > 0
    assert robot.quality().lost == ""
    assert errors[-1] < 0.05


def test_the_own_map_is_prepared_in_bands_after_kidnapping(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a map under construction nothing is prepared for localization before the robot is carried away."""
    inside: list[int] = []
    original = squared_distances

    def noted(occupied: np.ndarray[tuple[int, int], np.dtype[np.bool_]], radius: int) -> object:
        inside.append(occupied.size)
        return original(occupied, radius)

    class Carried(GridMapper):
        kidnapped = True

    mapper = Carried()
    scan = room_scan(Pose2())
    far = [Pose2(x_m=40.0 * k, y_m=30.0 * (k % 2)) for k in range(5)]
    for pose in far:  # a map of 160 x 30 m
        mapper.hit_grid.insert(pose, scan_points(scan, Twist2(), Pose2(), 30.0))
    switch = SlamModeSwitch(mapper)
    monkeypatch.setattr(likelihood_field, "squared_distances", noted)
    updates = 0
    while switch.localizer is None:
        before = len(inside)
        switch.update(Pose2(), scan, Twist2())
        assert len(inside) - before <= BANDS_PER_SCAN
        updates += 1
    assert updates > 5
    assert max(inside) <= 1.5 * BAND_CELLS
    assert math.prod(mapper.grid().cells.shape) > 5 * BAND_CELLS
