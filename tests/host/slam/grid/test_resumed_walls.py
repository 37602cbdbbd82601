"""Walls of a map that is saved and resumed again and again."""

import numpy as np
import pytest
from benchmarks.shared.distances import distance_from_scratch

from thumper.common.geometry import Pose2
from thumper.lidar.deskew import HIT, ScanPoints
from thumper.slam.grid.growing_grid import HitGrid

WALL_M, NOISE_M = 2.02, 0.04  # within one row of cells
SCANS, SESSIONS = 20, 30


def scan(rng: np.random.Generator) -> ScanPoints:
    x_m = np.linspace(-1.5, 1.5, 241)
    noise_m = rng.normal(0.0, NOISE_M, x_m.size)
    return ScanPoints(
        origins_m=np.zeros((x_m.size, 2)),
        ends_m=np.column_stack([x_m, WALL_M + noise_m]),
        kinds=np.full(x_m.size, HIT),
    )


def thickness_cells(grid: HitGrid) -> float:
    """Return the mean number of occupied cells across the middle of the wall."""
    column = round(-grid.corner_m[0] / grid.resolution_m)
    return float(grid.occupied()[:, column - 10 : column + 10].sum(axis=0).mean())


@pytest.mark.slow
def test_walls_do_not_thicken_from_session_to_session() -> None:
    rng, grid = np.random.default_rng(5), HitGrid(0.05, 0.5, 0.25)
    thickness = []
    for _ in range(SESSIONS):
        for _ in range(SCANS):
            grid.insert(Pose2(), scan(rng))
        thickness.append(thickness_cells(grid))
        grid = HitGrid.from_counts(grid.counts(), 0.05, 0.5, 0.25)
    assert max(thickness) < thickness[0] + 0.5
    np.testing.assert_allclose(grid.distance_m, distance_from_scratch(grid))


@pytest.mark.slow
def test_a_thin_leg_in_the_open_survives() -> None:
    grid = HitGrid(0.05, 0.5, 0.25)
    leg = ScanPoints(origins_m=np.zeros((1, 2)), ends_m=np.array([[1.02, 0.02]]), kinds=np.array([HIT]))
    wall = ScanPoints(origins_m=np.zeros((1, 2)), ends_m=np.array([[1.32, 0.02]]), kinds=np.array([HIT]))
    for _ in range(100):
        grid.insert(Pose2(y_m=0.3), wall)
    grid.insert(Pose2(), leg)
    before = int(grid.occupied().sum())
    grid = HitGrid.from_counts(grid.counts(), 0.05, 0.5, 0.25)
    assert int(grid.occupied().sum()) == before == 2
