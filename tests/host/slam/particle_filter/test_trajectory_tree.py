"""Memory over hours of mapping: trajectories are folded, old scans are thinned out."""

import math

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.deskew import HIT, ScanPoints
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.particle_filter.trajectory_tree import FOLD_EVERY, TrajectoryTree
from thumper.slam.pose_graph import submaps
from thumper.slam.pose_graph.submaps import SubmapGraph
from thumper.slam.scan_matching.patches import IndexArray

PARTICLES = 8


def reference_path(
    poses: list[FloatArray], parents: list[IndexArray], scans: list[tuple[int, Pose2]], best: int
) -> FloatArray:
    """Return the path, step by step from the end."""
    chain, particle = {}, best
    for step in range(len(poses) - 1, -1, -1):
        x_m, y_m, theta_rad = poses[step][particle]
        chain[step] = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
        particle = int(parents[step][particle])
    path = [chain[step] @ relative for step, relative in scans]
    return np.array([(p.x_m, p.y_m, math.remainder(p.theta_rad, math.tau)) for p in path])


def test_folded_tree_gives_the_same_path() -> None:
    rng = np.random.default_rng(1)
    tree, longest = TrajectoryTree(), 0
    poses: list[FloatArray] = []
    parents: list[IndexArray] = []
    scans: list[tuple[int, Pose2]] = []
    for step in range(600):
        poses.append(rng.uniform(-3.0, 3.0, (PARTICLES, 3)))
        resampled = rng.integers(0, PARTICLES, PARTICLES) if step % 7 == 0 else np.arange(PARTICLES)
        parents.append(resampled.astype(np.int32))
        tree.add_step(poses[-1], parents[-1])
        for _ in range(2):
            x_m, y_m, theta_rad = rng.uniform(-3.0, 3.0, 3)
            scans.append((step, Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)))
            tree.add_scan(scans[-1][1])
        longest = max(longest, len(tree._poses))
    assert longest < 5 * FOLD_EVERY  # not 600
    for best in (0, 5):
        difference = tree.path(best) - reference_path(poses, parents, scans, best)
        difference[:, 2] = np.remainder(difference[:, 2] + math.pi, math.tau) - math.pi
        assert np.abs(difference).max() < 1e-9


def test_particles_without_common_ancestor_are_not_folded() -> None:
    tree = TrajectoryTree()
    for step in range(2 * FOLD_EVERY):
        tree.add_step(np.full((PARTICLES, 3), float(step)), np.arange(PARTICLES, dtype=np.int32))
        tree.add_scan(Pose2())
    assert tree.steps == 2 * FOLD_EVERY
    np.testing.assert_allclose(tree.path(3)[:, 0], np.arange(2.0 * FOLD_EVERY))


def test_thinned_scans_still_cover_the_map(monkeypatch: pytest.MonkeyPatch) -> None:
    """A corridor along x, 40 m and back four times: 3200 scans, of which at most 500 may be kept."""
    monkeypatch.setattr(submaps, "MAX_KEPT_SCANS", 500)
    graph = SubmapGraph()
    beams_rad = np.linspace(-math.pi, math.pi, 90, endpoint=False)
    ends_m = np.column_stack((2.0 * np.cos(beams_rad), np.where(beams_rad < 0.0, -1.0, 1.0)))
    points = ScanPoints(origins_m=np.zeros((90, 2)), ends_m=ends_m, kinds=np.full(90, HIT, dtype=np.uint8))
    path_m = [x for _ in range(4) for x in (*np.arange(0.0, 40.0, 0.1), *np.arange(40.0, 0.0, -0.1))]
    for x_m in path_m:
        graph.add(Pose2(x_m=float(x_m)), points)
    kept = sum(scan is not None for scan in graph.scans)
    assert 200 < kept <= 500
    np.testing.assert_allclose(graph.path()[:, 0], path_m, atol=1e-9)
    hit_grid = HitGrid(0.1, 0.5, 0.25)
    half, left_m = graph.insert_scans(hit_grid, 0, None, 10_000.0, math.inf)
    assert 0 < half < len(path_m)
    assert left_m <= 0.0
    end, _ = graph.insert_scans(hit_grid, half, None, math.inf, math.inf)
    assert end == len(graph.scans) == len(path_m)
    grid = hit_grid.grid(percent=False)
    for x_m in np.arange(1.0, 39.0, 0.5):
        assert grid.cells[grid.cell_of(float(x_m), 1.02)] == 100
