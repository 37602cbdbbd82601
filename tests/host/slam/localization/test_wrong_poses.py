"""Places that look alike: wrong given poses, wrong search results, and another building."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.shared.rooms import rectangle, room_scan

from tests.variants import some_of
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.gps.position_prior import PositionPrior
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.localization.amcl import Amcl
from thumper.slam.mapper import MapperUpdate
from thumper.slam.mode_switch import SlamModeSwitch
from thumper_hil.world.world import World

APART_M = 10.0


def room(middle_m: float) -> FloatArray:
    """Return a room of 6 x 3 m; a box in a corner makes it asymmetric."""
    low_m, high_m = middle_m - 3.0, middle_m + 3.0
    return np.concatenate((rectangle(low_m, -1.5, high_m, 1.5), rectangle(low_m, 0.9, low_m + 0.8, 1.5)))


TWINS = np.concatenate((room(0.0), room(APART_M)))
CUPBOARD = rectangle(1.4, 0.3, 3.0, 1.5)  # in the first room


def grid_of(*walls: FloatArray) -> OccupancyGrid:
    return World(segments_m=np.concatenate(walls), circles_m=np.zeros((0, 3))).to_grid()


def drive(
    robot: Amcl | SlamModeSwitch, path: list[Pose2], walls: FloatArray, range_m: float, seed: int = 2
) -> list[tuple[float, MapperUpdate, str]]:
    """Return error [m], update and doubt at each pose, with odometry that reads 3 % too large."""
    odometry, rng, results = Pose2(), np.random.default_rng(seed), []
    for before, pose in itertools.pairwise([path[0], *path]):
        step = before.inverse() @ pose
        odometry = odometry @ replace(step, x_m=1.03 * step.x_m, theta_rad=1.03 * step.theta_rad)
        scan = room_scan(pose, walls=walls, noise_m=0.01, rng=rng)
        near = replace(scan, ranges_m=np.where(scan.ranges_m > range_m, np.nan, scan.ranges_m))
        update = robot.update(odometry, near, Twist2())
        results.append((update.map_from_base.distance_m(pose), update, robot.quality().lost))
    return results


def eastwards(x_m: float, y_m: float, steps: int) -> list[Pose2]:
    return [Pose2(x_m=x_m + 0.1 * k, y_m=y_m) for k in range(steps)]


@pytest.mark.parametrize("y_m", some_of([-0.4, -0.1]))
@pytest.mark.parametrize("true_m", [0.0, APART_M])
@pytest.mark.parametrize("given_m", [0.0, APART_M])
def test_given_room_of_two_similar_ones_is_kept_only_if_correct(
    given_m: float, true_m: float, y_m: float
) -> None:
    """At first the rooms look alike; then a cupboard is visible, or is missing."""
    path = eastwards(true_m - 1.4, y_m, 36)
    given = Pose2(x_m=given_m - 1.3, y_m=y_m + 0.1, theta_rad=0.05)
    localizer = Amcl(grid_of(TWINS, CUPBOARD), map_from_base=given, std_m=0.1, std_rad=0.05)
    results = drive(localizer, path, np.concatenate((TWINS, CUPBOARD)), 2.5)
    right = [error_m < 0.15 for error_m, *_ in results]
    if given_m == true_m:
        assert all(right)
        assert not any(doubt for *_, doubt in results)
    else:
        assert not any(right[:3])  # the user is trusted until scans contradict
        assert all(right[-10:])
        assert not any(doubt for *_, doubt in results[-10:])


@pytest.mark.parametrize("seed", [2, 3, 4])
def test_mapping_does_not_resume_at_a_wrong_place_that_fits_first(seed: int) -> None:
    """A box was removed here, so the other room fits better until a cupboard is visible."""
    box = rectangle(-2.2, -1.5, -0.9, -0.8)
    robot = SlamModeSwitch(GridMapper())
    robot.resume_from(HitCounts.from_grid(grid_of(TWINS, CUPBOARD, box)), None)
    results = drive(
        robot, eastwards(-1.6, -0.1, 30), np.concatenate((TWINS, CUPBOARD)), range_m=2.5, seed=seed
    )
    assert results[0][0] > 5.0
    assert not any(update.integrated and error_m > 0.1 for error_m, update, _ in results)
    assert robot.localizer is None
    assert results[-1][0] < 0.1


def corridor(spacing_m: float) -> FloatArray:
    """Return a corridor of 16 x 2 m with pilasters on both sides."""
    along_m = 0.7 + spacing_m * np.arange(int(15.0 / spacing_m))
    north = [rectangle(x_m, 0.75, x_m + 0.3, 1.0) for x_m in along_m]
    south = [rectangle(x_m, -1.0, x_m + 0.2, -0.75) for x_m in along_m + 0.37 * spacing_m]
    return np.concatenate((rectangle(0.0, -1.0, 16.0, 1.0), *north, *south))


@pytest.mark.parametrize("spacing_m", [1.25, 1.4])
def test_mapping_does_not_resume_in_a_corridor_of_another_building(spacing_m: float) -> None:
    """Its scans fit 0.7 to 0.8 anywhere, but at places that do not follow the odometry."""
    robot = SlamModeSwitch(GridMapper())
    robot.resume_from(HitCounts.from_grid(grid_of(corridor(1.0))), None)
    results = drive(robot, eastwards(3.0, 0.1, 60), corridor(spacing_m), range_m=4.0)
    assert not any(update.integrated for _, update, _ in results)
    assert np.mean([update.match_score for _, update, _ in results]) > 0.7


def test_mapping_resumes_in_the_same_corridor() -> None:
    robot = SlamModeSwitch(GridMapper())
    robot.resume_from(HitCounts.from_grid(grid_of(corridor(1.0), rectangle(5.4, 0.3, 5.7, 0.6))), None)
    results = drive(
        robot,
        eastwards(3.0, 0.1, 40),
        np.concatenate((corridor(1.0), rectangle(5.4, 0.3, 5.7, 0.6))),
        range_m=4.0,
    )
    assert robot.localizer is None
    assert results[-1][0] < 0.1


@pytest.mark.parametrize("age_s", [0.0, 60.0])
@pytest.mark.parametrize("gps_m", [0.0, APART_M, 2.0 * APART_M])
def test_a_search_finds_no_place_far_from_a_fresh_position_by_gps(gps_m: float, age_s: float) -> None:
    path = eastwards(-1.4, -0.4, 2)
    localizer = Amcl(grid_of(TWINS))
    localizer.set_position_prior(PositionPrior(gps_m - 1.4, -0.4, 0.05, -age_s))
    error_m, _, lost = drive(localizer, path, TWINS, 2.5)[-1]
    if age_s > 0.0:
        assert "GPS" not in lost
    elif gps_m > APART_M:
        assert "the GPS is at (18.60, -0.40) in the map, and no place within 2 m of it fits the scan" in lost
    else:
        assert error_m == pytest.approx(gps_m, abs=0.1)
