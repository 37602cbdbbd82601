"""The picture of a map shows free space, walls and the path."""

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from thumper.common.colours import BLUE, FREE_COLOUR, OCCUPIED_COLOUR, ORANGE
from thumper.maps.map_server_io import load_map, save_map
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from thumper.maps.plot import plot_map


@pytest.mark.parametrize(("planned", "path_colour"), [(True, ORANGE), (False, BLUE)])
def test_free_space_walls_and_path_are_visible(tmp_path: Path, planned: bool, path_colour: str) -> None:
    cells = np.full((60, 80), FREE, np.int8)
    cells[[0, -1]] = OCCUPIED
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    path_m = np.column_stack((np.linspace(0.5, 3.5, 50), np.full(50, 1.5)))
    plot_map(grid, path_m, tmp_path / "map.png", "a room", planned=planned)
    picture = np.rint(255 * matplotlib.image.imread(tmp_path / "map.png")[:, :, :3])
    expected = ((FREE_COLOUR, 2, 10_000), (OCCUPIED_COLOUR, 2, 1000), (path_colour, 60, 300))
    for colour, tolerance, least in expected:
        rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
        assert (np.abs(picture - rgb).max(axis=2) <= tolerance).sum() > least, colour


def test_keepout_zones_are_purple_and_the_walls_in_them_are_not(tmp_path: Path) -> None:
    cells = np.full((60, 80), FREE, np.int8)
    cells[:, 40:] = OCCUPIED
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    keepout = np.zeros(cells.shape, np.bool_)
    keepout[:30] = True
    plot_map(grid, np.zeros((2, 2)), tmp_path / "map.png", "a room", keepout=keepout)
    picture = matplotlib.image.imread(tmp_path / "map.png")[:, :, :3]
    purple = (picture[:, :, 0] - picture[:, :, 1] > 0.1) & (picture[:, :, 2] - picture[:, :, 1] > 0.1)
    assert purple.sum() == pytest.approx(40 * 30 * 15**2, rel=0.03)  # 15 pixels per cell; the swatch


def test_a_map_without_a_cell_is_saved_and_drawn(tmp_path: Path) -> None:
    """On open ground the lidar reaches nothing."""
    cells = np.empty((0, 0), np.int8)
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    save_map(grid, tmp_path / "map.yaml")
    assert (load_map(tmp_path / "map.yaml").cells == UNKNOWN).all()
    plot_map(grid, np.zeros((2, 2)), tmp_path / "map.png", "open ground")
    assert matplotlib.image.imread(tmp_path / "map.png").size
