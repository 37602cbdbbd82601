"""Hours of mapping: the particles' past is folded, and says the same; old scans are thinned."""

import math

import numpy as np
import pytest

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.deskew import HIT, ScanPoints
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.particle_filter.patches import IndexArray
from thumper.slam.particle_filter.trajectory_tree import FOLD_EVERY, TrajectoryTree
from thumper.slam.pose_graph import submaps
from thumper.slam.pose_graph.submaps import SubmapGraph

PARTICLES = 8


def told(
    poses: list[FloatArray], parents: list[IndexArray], scans: list[tuple[int, Pose2]], best: int
) -> FloatArray:
    """The path, step by step from the end."""
    chain, who = {}, best
    for step in range(len(poses) - 1, -1, -1):
        x_m, y_m, theta_rad = poses[step][who]
        chain[step] = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
        who = int(parents[step][who])
    path = [chain[step] @ relative for step, relative in scans]
    return np.array([(p.x_m, p.y_m, math.remainder(p.theta_rad, math.tau)) for p in path])


def test_a_folded_lineage_tells_the_same_path_in_less_memory() -> None:
    rng = np.random.default_rng(1)
    lineage, longest = TrajectoryTree(), 0
    poses: list[FloatArray] = []
    parents: list[IndexArray] = []
    scans: list[tuple[int, Pose2]] = []
    for step in range(600):
        poses.append(rng.uniform(-3.0, 3.0, (PARTICLES, 3)))
        resampled = rng.integers(0, PARTICLES, PARTICLES) if step % 7 == 0 else np.arange(PARTICLES)
        parents.append(resampled.astype(np.int32))
        lineage.step(poses[-1], parents[-1])
        for _ in range(2):
            x_m, y_m, theta_rad = rng.uniform(-3.0, 3.0, 3)
            scans.append((step, Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)))
            lineage.scan(scans[-1][1])
        longest = max(longest, len(lineage._poses))
    assert longest < 5 * FOLD_EVERY  # not 600
    for best in (0, 5):
        difference = lineage.path(best) - told(poses, parents, scans, best)
        difference[:, 2] = np.remainder(difference[:, 2] + math.pi, math.tau) - math.pi
        assert np.abs(difference).max() < 1e-9


def test_particles_that_never_meet_again_are_not_folded() -> None:
    lineage = TrajectoryTree()
    for step in range(2 * FOLD_EVERY):
        lineage.step(np.full((PARTICLES, 3), float(step)), np.arange(PARTICLES, dtype=np.int32))
        lineage.scan(Pose2())
    assert lineage.steps == 2 * FOLD_EVERY
    np.testing.assert_allclose(lineage.path(3)[:, 0], np.arange(2.0 * FOLD_EVERY))


def test_old_scans_are_thinned_and_the_map_still_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """A corridor along x, 40 m and back four times: 3200 scans, of which no more than 500 may be kept."""
    monkeypatch.setattr(submaps, "MOST_KEPT", 500)
    places = SubmapGraph(place_m=2.0)
    beams_rad = np.linspace(-math.pi, math.pi, 90, endpoint=False)
    ends_m = np.column_stack((2.0 * np.cos(beams_rad), np.where(beams_rad < 0.0, -1.0, 1.0)))
    points = ScanPoints(origins_m=np.zeros((90, 2)), ends_m=ends_m, kinds=np.full(90, HIT, dtype=np.uint8))
    way_m = [x for _ in range(4) for x in (*np.arange(0.0, 40.0, 0.1), *np.arange(40.0, 0.0, -0.1))]
    for x_m in way_m:
        places.add(Pose2(x_m=float(x_m)), points)
    kept = sum(scan is not None for scan in places.scans)
    assert 200 < kept <= 500
    np.testing.assert_allclose(places.path()[:, 0], way_m, atol=1e-9)
    cells = HitGrid(0.1, 0.5, 0.25)
    half = places.enter(cells, 0, None, 100)
    assert places.enter(cells, half, None, 10_000) == len(places.scans) == len(way_m)
    grid = cells.grid(percent=False)
    for x_m in np.arange(1.0, 39.0, 0.5):
        assert grid.cells[grid.cell_of(float(x_m), 1.02)] == 100
