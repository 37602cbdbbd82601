"""Whether two paths pass all obstacles on the same sides, compared with winding numbers of single points."""

import numpy as np
import pytest

from thumper.common.geometry import FloatArray
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.planners.homotopy import is_same_side, winds_round_obstacle
from thumper_hil.courses.route_changes import winding_numbers

ROWS, COLS = 9, 12
ORIGIN_M, RESOLUTION_M = np.array((-3.25, 1.5)), 0.125


def map_with(*obstacles: tuple[int, int]) -> Costmap:
    """Return a map with obstacles, given as row and column."""
    squared = np.full((ROWS, COLS), 9, np.int32)
    for cell in obstacles:
        squared[cell] = 0
    return Costmap(
        costs=np.zeros((ROWS, COLS), np.uint8),
        squared_cells=squared,
        resolution_m=RESOLUTION_M,
        origin_x_m=ORIGIN_M[0],
        origin_y_m=ORIGIN_M[1],
    )


@pytest.mark.parametrize("on_cells", [False, True], ids=["anywhere", "through the middles of cells"])
def test_each_cell_between_two_random_paths_counts(on_cells: bool) -> None:
    """The paths cross themselves and each other, and leave the map."""
    rng = np.random.default_rng(1)
    middles = np.argwhere(np.ones((ROWS, COLS)))[:, ::-1].astype(np.float64) + 0.5
    for _ in range(60):
        loop = rng.uniform((-3.0, -3.0), (COLS + 3.0, ROWS + 3.0), (rng.integers(2, 14), 2))
        if on_cells:
            loop = np.floor(2.0 * loop) / 2.0
        wound = []
        for row, col in np.ndindex(ROWS, COLS):
            wound.append(winds_round_obstacle(loop, map_with((row, col)).squared_cells))
        assert wound == (winding_numbers(loop, middles) != 0).tolist()


def test_paths_in_a_map_with_some_obstacles() -> None:
    rng = np.random.default_rng(2)
    answers = []
    for _ in range(300):
        cells = rng.integers((0, 0), (ROWS, COLS), (rng.integers(0, 12), 2))
        obstacles_m = ORIGIN_M + (cells[:, ::-1] + 0.5) * RESOLUTION_M
        ends = rng.uniform((0.0, 0.0), (COLS, ROWS), (2, 2))
        old_m, new_m = (path_between(ends, rng) for _ in range(2))
        expected = not winding_numbers(np.vstack((old_m, new_m[::-1])), obstacles_m).any()
        assert is_same_side(new_m, old_m, map_with(*map(tuple, cells))) is expected
        answers.append(expected)
    assert 60 < sum(answers) < 240


def path_between(ends: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return a random path between two ends, shape (2, 2) [cells], as shape (n, 2) [m]."""
    line = np.linspace(ends[0], ends[1], 10)
    line[1:-1] += rng.normal(0.0, 1.0, (8, 2))
    return ORIGIN_M + line * RESOLUTION_M
