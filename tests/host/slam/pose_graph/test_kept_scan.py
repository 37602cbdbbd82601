import numpy as np
import pytest

from thumper.common.geometry import Pose2
from thumper.lidar.deskew import HIT, INVALID, MISS, ScanPoints
from thumper.slam.pose_graph import submaps
from thumper.slam.pose_graph.kept_scan import keep_scan

POSE = Pose2(x_m=3.0, y_m=-2.0, theta_rad=0.7)
RNG = np.random.default_rng(4)


def random_scan(*, moving: bool) -> ScanPoints:
    origins_m = RNG.normal(size=(90, 2)) if moving else np.full((90, 2), 0.25)
    kinds = RNG.choice((HIT, HIT, MISS, INVALID), 90).astype(np.uint8)
    return ScanPoints(origins_m=origins_m, ends_m=RNG.normal(0.0, 9.0, (90, 2)), kinds=kinds)


@pytest.mark.parametrize("moving", [False, True])
def test_the_valid_beams_are_kept(moving: bool) -> None:
    points = random_scan(moving=moving)
    kept = keep_scan(5, POSE, points)
    valid = points.kinds != INVALID
    assert (kept.submap, kept.submap_from_base) == (5, POSE)
    assert len(kept.origins_m) == (valid.sum() if moving else 1)  # a stationary robot has one origin
    np.testing.assert_array_equal(kept.points().origins_m, points.origins_m[valid].astype(np.float32))
    np.testing.assert_array_equal(kept.points().ends_m, points.ends_m[valid].astype(np.float32))
    np.testing.assert_array_equal(kept.kinds, points.kinds[valid])


def test_hits_are_thinned_evenly() -> None:
    points = random_scan(moving=True)
    kept = keep_scan(0, Pose2(), points)
    hits_m = POSE.apply(kept.ends_m[kept.kinds == HIT].astype(np.float64))
    np.testing.assert_allclose(kept.thinned_hits_m(POSE, len(hits_m) / 3.0), hits_m[::3])
    np.testing.assert_allclose(kept.thinned_hits_m(POSE, 1000.0), hits_m)


def test_a_scan_without_a_valid_beam_is_kept_empty() -> None:
    nothing = ScanPoints(origins_m=np.zeros((9, 2)), ends_m=np.ones((9, 2)), kinds=np.zeros(9, np.uint8))
    kept = keep_scan(0, POSE, nothing)
    assert kept.points().ends_m.shape == kept.points().origins_m.shape == (0, 2)


def test_near_points_are_in_the_same_cell_or_in_one_next_to_it() -> None:
    points_m, others_m = RNG.uniform(-3.0, 3.0, (300, 2)), RNG.uniform(-3.0, 3.0, (60, 2))
    cells, others = np.floor(points_m / 0.15), np.floor(others_m / 0.15)
    expected = (np.abs(cells[:, np.newaxis] - others).max(axis=2) <= 1).any(axis=1)
    assert 30 < expected.sum() < 270
    np.testing.assert_array_equal(submaps._is_near(points_m, others_m, 0.15), expected)
    assert not submaps._is_near(points_m, others_m[:0], 0.15).any()
