"""Trust in a place: scans that fit a map with gaps, and matches that agree with odometry or not."""

import re
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.shared.rooms import ROOM, room_scan

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.deskew import scan_points
from thumper.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from thumper.slam.localization.likelihood_field import LikelihoodField
from thumper.slam.localization.options import AmclOptions
from thumper.slam.localization.scan_likelihood import ScanLikelihood
from thumper.slam.scan_matching.pose_trust import PoseTrust
from thumper_hil.world.world import World

GRID = World(segments_m=ROOM, circles_m=np.zeros((0, 3))).to_grid()
HERE = Pose2(x_m=-0.5, y_m=0.5)


def updated(
    trust: PoseTrust, count: int, *, fit: float, push_m: float, distance_m: float = 0.11
) -> PoseTrust:
    for _ in range(count):
        trust.update(fit, 1.0, distance_m, push_m)
    return trust


@pytest.mark.parametrize("fit", [0.7999, 0.79, 0.5, 0.001])
def test_support_never_looks_as_large_as_what_it_needs(fit: float) -> None:
    reason = updated(PoseTrust(trusted=False), 1, fit=fit, push_m=0.0).unconfirmed
    support, needed = (int(number) for number in re.findall(r"(\d+) %", reason))
    assert support < needed == 80


def test_support_below_nothing_is_no_share() -> None:
    trust = updated(PoseTrust(trusted=False), 2, fit=0.3, push_m=0.4, distance_m=0.2)
    assert trust.doubt == "the scans contradict the best place on the map"


def test_place_is_confirmed_by_ten_scans_over_a_metre() -> None:
    trust = updated(PoseTrust(trusted=False), 9, fit=0.8, push_m=0.01)
    assert not trust.confirmed
    assert not updated(
        PoseTrust(trusted=False), 40, fit=0.9, push_m=0.0, distance_m=0.02
    ).confirmed  # it turns on the spot
    updated(trust, 2, fit=0.8, push_m=0.01)
    assert trust.confirmed
    assert trust.doubt == ""


def test_one_clear_scan_is_trusted_and_need_only_hold() -> None:
    assert updated(PoseTrust(trusted=False), 1, fit=0.75, push_m=0.0).doubt
    trust = updated(PoseTrust(trusted=False), 1, fit=0.85, push_m=0.0)
    assert trust.doubt == ""
    assert updated(trust, 1, fit=0.4, push_m=0.0).doubt == ""


def test_place_that_pushes_the_pose_off_odometry_is_rejected() -> None:
    trust = updated(PoseTrust(trusted=False), 30, fit=0.8, push_m=0.05)
    assert not trust.confirmed
    assert trust.doubt
    assert trust.rejected


def test_jump_restarts_the_count() -> None:
    trust = updated(PoseTrust(trusted=False), 9, fit=0.9, push_m=0.01)
    updated(trust, 1, fit=0.6, push_m=2.0)
    assert not trust.confirmed
    assert trust.doubt  # although the scans before were clear
    updated(trust, 8, fit=0.9, push_m=0.01)
    assert not trust.confirmed
    updated(trust, 2, fit=0.9, push_m=0.01)
    assert trust.confirmed


def test_given_place_is_rejected_only_if_scans_do_not_fit() -> None:
    trust = updated(PoseTrust(trusted=True), 30, fit=0.5, push_m=0.3)
    assert not trust.rejected
    assert trust.doubt == ""
    assert not updated(trust, 1, fit=0.4, push_m=0.0).rejected
    assert updated(trust, 19, fit=0.4, push_m=0.0).rejected


def fit(grid: OccupancyGrid, pose: Pose2, walls: FloatArray = ROOM) -> float:
    """Return the fit of the scan taken at HERE."""
    points = scan_points(room_scan(HERE, walls=walls), Twist2(), Pose2(), 30.0)
    hits_m = points.hits_m
    return ScanLikelihood(np.zeros_like(hits_m), hits_m, LikelihoodField(grid), AmclOptions()).fit(pose)


def known_up_to(x_m: float) -> OccupancyGrid:
    cells = GRID.cells.copy()
    cells[:, GRID.cell_of(x_m, 0.0)[1] :] = UNKNOWN
    return replace(GRID, cells=cells)


@pytest.mark.parametrize("x_m", [9.0, 2.5, 1.0])
def test_beams_into_unknown_space_do_not_count(x_m: float) -> None:
    assert fit(known_up_to(x_m), HERE) > 0.95


def test_at_least_half_of_the_beams_count() -> None:
    assert 0.05 < fit(known_up_to(-1.5), HERE) < 0.7
    assert fit(known_up_to(-9.0), HERE) == 0.0
    outside = World(segments_m=ROOM + 50.0, circles_m=np.zeros((0, 3))).to_grid()
    assert fit(outside, HERE) == 0.0


def test_beams_through_walls_count_against_a_pose() -> None:
    shelf = np.concatenate((ROOM, np.array([[-1.5, 1.5, 2.0, 1.5]])))
    with_shelf = World(segments_m=shelf, circles_m=np.zeros((0, 3))).to_grid()
    assert 0.5 < fit(GRID, HERE, shelf) < 0.8  # the shelf is new
    assert 0.5 < fit(with_shelf, HERE) < 0.8  # the shelf is gone; the walls behind it are visible
    assert fit(with_shelf, HERE @ Pose2(y_m=-1.2)) < 0.0
