"""Cropped, filled and rotated maps: each cell keeps its position in the world."""

import math
from pathlib import Path

import numpy as np
import pytest

from thumper.common.errors import ThumperError
from thumper.maps.edit import Box, crop, fill_box, rotate, trim
from thumper.maps.map_server_io import load_map, load_rotated_map, save_map
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid


def corner_map() -> OccupancyGrid:
    cells = np.full((40, 60), UNKNOWN, dtype=np.int8)
    cells[10:20, 20:30] = FREE
    cells[10, 20] = OCCUPIED
    return OccupancyGrid(cells=cells, resolution_m=0.1, origin_x_m=-1.0, origin_y_m=-2.0)


def box(x0: float, y0: float, x1: float, y1: float) -> Box:
    return Box(x0_m=x0, y0_m=y0, x1_m=x1, y1_m=y1)


def test_trimming_keeps_every_known_cell_in_place() -> None:
    grid = corner_map()
    small = trim(grid, margin_m=0.2)
    assert small.cells.shape == (14, 14)
    assert small.cells[small.cell_of(*grid.centre_of(10, 20))] == OCCUPIED
    assert np.count_nonzero(small.cells == FREE) == 99
    nothing = OccupancyGrid(cells=grid.cells[:5, :5], resolution_m=0.1, origin_x_m=0.0, origin_y_m=0.0)
    assert trim(nothing) is nothing


@pytest.mark.parametrize(
    "corners", [(1.0, -1.0, 1.5, -0.6), (1.5, -0.6, 1.0, -1.0), (1.04, -0.96, 1.44, -0.64)]
)
def test_cropping_keeps_the_cells_that_the_box_touches(corners: tuple[float, float, float, float]) -> None:
    grid = corner_map()
    small = crop(grid, box(*corners))
    assert (small.origin_x_m, small.origin_y_m) == pytest.approx((1.0, -1.0))
    np.testing.assert_array_equal(small.cells, grid.cells[10:14, 20:25])


def test_cropping_never_enlarges_a_map() -> None:
    grid = corner_map()
    np.testing.assert_array_equal(crop(grid, box(-9, -9, 9, 9)).cells, grid.cells)


def test_only_the_box_is_filled() -> None:
    grid = corner_map()
    new = fill_box(grid, box(1.2, -0.9, 1.2, -0.5), OCCUPIED)  # a line
    np.testing.assert_array_equal(np.argwhere(new.cells != grid.cells), [(row, 22) for row in range(11, 15)])
    assert (new.cells[11:15, 22] == OCCUPIED).all()
    again = fill_box(new, box(1.0, -1.0, 2.0, 0.0), UNKNOWN)
    assert (again.cells == UNKNOWN).all()
    assert (grid.cells[10, 20], new.cells[10, 20]) == (OCCUPIED, OCCUPIED)  # the inputs are unchanged


@pytest.mark.parametrize("corners", [(6.0, 0.0, 7.0, 1.0), (0.0, -9.0, 1.0, -2.5)])
def test_a_box_outside_the_map_is_refused(corners: tuple[float, float, float, float]) -> None:
    with pytest.raises(ThumperError, match="lies outside the map, which extends from"):
        fill_box(corner_map(), box(*corners), FREE)
    with pytest.raises(ThumperError, match="lies outside the map, which extends from"):
        crop(corner_map(), box(*corners))


def test_four_rotations_by_90_degrees_change_nothing() -> None:
    grid = corner_map()
    turned = rotate(grid, math.pi / 2)
    x_m, y_m = grid.centre_of(10, 20)
    assert turned.cells[turned.cell_of(-y_m, x_m)] == OCCUPIED
    for _ in range(3):
        turned = rotate(turned, math.pi / 2)
    np.testing.assert_array_equal(turned.cells, grid.cells)
    assert (turned.origin_x_m, turned.origin_y_m) == pytest.approx((-1.0, -2.0))


@pytest.mark.parametrize("yaw_rad", [0.0, 0.5, -2.2])
def test_a_map_with_a_yaw_is_rotated_by_it(tmp_path: Path, yaw_rad: float) -> None:
    grid = corner_map()
    save_map(grid, tmp_path / "a.yaml")
    text = (tmp_path / "a.yaml").read_text()
    (tmp_path / "a.yaml").write_text(text.replace("-2.0, 0.0]", f"-2.0, {yaw_rad}]"))
    if yaw_rad:
        with pytest.raises(ThumperError, match=r"yaw .*thumper edit .*a\.yaml --out"):
            load_map(tmp_path / "a.yaml")
    turned, found_rad = load_rotated_map(tmp_path / "a.yaml")
    assert found_rad == yaw_rad
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    for row, col in np.ndindex(*grid.cells.shape):
        along_m, across_m = 0.1 * (col + 0.5), 0.1 * (row + 0.5)  # from the image's lower left corner
        x_m, y_m = -1.0 + cos * along_m - sin * across_m, -2.0 + sin * along_m + cos * across_m
        r, c = turned.cell_of(x_m, y_m)
        assert grid.cells[row, col] in turned.cells[max(0, r - 1) : r + 2, max(0, c - 1) : c + 2]
    for state in (FREE, UNKNOWN):
        assert (
            np.count_nonzero(rotate(grid, yaw_rad).cells == state)
            >= np.count_nonzero(grid.cells == state) - 3
        )
