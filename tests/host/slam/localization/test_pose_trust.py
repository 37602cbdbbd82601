"""What speaks for a place: scans that fit a map with gaps, and looks that agree with odometry or do not."""

from dataclasses import replace

import numpy as np
import pytest

from tests.host.slam.rooms import ROOM, room_scan
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.deskew import scan_points
from thumper.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from thumper.slam.localization.likelihood_field import LikelihoodField
from thumper.slam.localization.options import AmclOptions
from thumper.slam.localization.pose_trust import PoseTrust
from thumper.slam.localization.scan_likelihood import ScanLikelihood
from thumper_hil.world.world import World

GRID = World(segments_m=ROOM, circles_m=np.zeros((0, 3))).to_grid()
HERE = Pose2(x_m=-0.5, y_m=0.5)


def looks(evidence: PoseTrust, count: int, *, fit: float, off_m: float, way_m: float = 0.11) -> PoseTrust:
    for _ in range(count):
        evidence.add(fit, 1.0, way_m, off_m)
    return evidence


def test_a_place_is_proven_by_ten_looks_over_a_metre() -> None:
    evidence = looks(PoseTrust(vouched=False), 9, fit=0.8, off_m=0.01)
    assert not evidence.proven
    assert not looks(
        PoseTrust(vouched=False), 40, fit=0.9, off_m=0.0, way_m=0.02
    ).proven  # it stands and turns
    looks(evidence, 2, fit=0.8, off_m=0.01)
    assert evidence.proven
    assert evidence.doubt == ""


def test_one_clear_look_is_believed_and_need_only_hold() -> None:
    assert looks(PoseTrust(vouched=False), 1, fit=0.75, off_m=0.0).doubt
    evidence = looks(PoseTrust(vouched=False), 1, fit=0.85, off_m=0.0)
    assert evidence.doubt == ""
    assert looks(evidence, 1, fit=0.4, off_m=0.0).doubt == ""


def test_a_place_that_fits_but_pulls_the_pose_off_odometry_is_given_up() -> None:
    evidence = looks(PoseTrust(vouched=False), 30, fit=0.8, off_m=0.05)
    assert not evidence.proven
    assert evidence.doubt
    assert evidence.refuted


def test_looks_before_a_leap_were_at_another_place() -> None:
    evidence = looks(PoseTrust(vouched=False), 9, fit=0.9, off_m=0.01)
    looks(evidence, 1, fit=0.6, off_m=2.0)
    assert not evidence.proven
    assert evidence.doubt  # though what went before was clear
    looks(evidence, 8, fit=0.9, off_m=0.01)
    assert not evidence.proven
    looks(evidence, 2, fit=0.9, off_m=0.01)
    assert evidence.proven


def test_a_place_that_was_vouched_for_is_given_up_only_where_scans_do_not_fit() -> None:
    evidence = looks(PoseTrust(vouched=True), 30, fit=0.5, off_m=0.3)
    assert not evidence.refuted
    assert evidence.doubt == ""
    assert not looks(evidence, 1, fit=0.4, off_m=0.0).refuted
    assert looks(evidence, 19, fit=0.4, off_m=0.0).refuted


def fit(grid: OccupancyGrid, pose: Pose2, walls: FloatArray = ROOM) -> float:
    """Of the scan that is seen from HERE."""
    points = scan_points(room_scan(HERE, walls=walls), Twist2(), Pose2(), 30.0)
    hits_m = points.hits_m()
    return ScanLikelihood(np.zeros_like(hits_m), hits_m, LikelihoodField(grid, 0.5), AmclOptions()).fit(pose)


def known_up_to(x_m: float) -> OccupancyGrid:
    cells = GRID.cells.copy()
    cells[:, GRID.cell_of(x_m, 0.0)[1] :] = UNKNOWN
    return replace(GRID, cells=cells)


@pytest.mark.parametrize("x_m", [9.0, 2.5, 1.0])
def test_what_ends_where_the_map_knows_nothing_says_nothing(x_m: float) -> None:
    assert fit(known_up_to(x_m), HERE) > 0.95


def test_half_of_the_beams_are_asked_at_least() -> None:
    assert 0.05 < fit(known_up_to(-1.5), HERE) < 0.7
    assert fit(known_up_to(-9.0), HERE) == 0.0
    outside = World(segments_m=ROOM + 50.0, circles_m=np.zeros((0, 3))).to_grid()
    assert fit(outside, HERE) == 0.0


def test_what_ends_in_free_space_says_nothing_for_a_pose_and_what_goes_through_walls_speaks_against() -> None:
    shelf = np.concatenate((ROOM, np.array([[-1.5, 1.5, 2.0, 1.5]])))
    with_shelf = World(segments_m=shelf, circles_m=np.zeros((0, 3))).to_grid()
    assert 0.5 < fit(GRID, HERE, shelf) < 0.8  # it is new
    assert 0.5 < fit(with_shelf, HERE) < 0.8  # it is gone: behind it are walls as ever
    assert fit(with_shelf, HERE @ Pose2(y_m=-1.2)) < 0.0
