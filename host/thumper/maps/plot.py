"""A picture of a map and the way through it, for people."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

PAPER, FLOOR, WALL, WAY = "#e9edf1", "#ffffff", "#1c2733", "#d1495b"
LONG_SIDE_PX, BORDER_PX, LOW_PX, DPI = 1200, 90, 54, 120


def plot_map(grid: OccupancyGrid, path_m: FloatArray, png_path: Path, title: str) -> None:
    """Write a PNG of the known part of the map and the path, shape (n, 2), axes in metres.

    A cell becomes a whole number of pixels, or a whole number of cells one pixel: `imshow` would resample in
    floating point and take more memory than the mapping did.
    """
    known = np.argwhere(grid.cells != UNKNOWN)
    margin = max(4, round(0.5 / grid.resolution_m))
    rows, cols = grid.cells.shape
    low = np.maximum(known.min(axis=0) - margin, 0) if known.size else np.zeros(2, dtype=int)
    high = np.minimum(known.max(axis=0) + margin + 1, (rows, cols)) if known.size else np.array([rows, cols])
    cells = grid.cells[low[0] : high[0], low[1] : high[1]]
    image, cell_px = _scaled(cells)
    height_px, width_px = image.shape
    size_px = np.array([width_px + 1.3 * BORDER_PX, height_px + 1.3 * BORDER_PX])
    figure = Figure(figsize=tuple(size_px / DPI), dpi=DPI)
    FigureCanvasAgg(figure)  # draws without a display
    pixels = _palette()[np.clip(image, UNKNOWN, OCCUPIED)]
    figure.figimage(pixels, xo=BORDER_PX, yo=LOW_PX, origin="lower", zorder=-1)  # else it hides the axes
    axes = figure.add_axes(
        (BORDER_PX / size_px[0], LOW_PX / size_px[1], width_px / size_px[0], height_px / size_px[1])
    )
    axes.patch.set_visible(False)
    if path_m.shape[0]:
        axes.plot(path_m[:, 0], path_m[:, 1], color=WAY, linewidth=1.0, alpha=0.85, label="path")
        axes.plot(*path_m[0], "o", color=WAY, markersize=7, markerfacecolor="white", label="start")
        axes.plot(*path_m[-1], "o", color=WAY, markersize=7, label="end")
        axes.legend(loc="upper right", frameon=True, framealpha=0.9)
    x_m, y_m = grid.origin_x_m + low[1] * grid.resolution_m, grid.origin_y_m + low[0] * grid.resolution_m
    px_m = grid.resolution_m / cell_px
    axes.set(title=title, xlabel="x [m]", ylabel="y [m]")
    axes.set(xlim=(x_m, x_m + width_px * px_m), ylim=(y_m, y_m + height_px * px_m))
    axes.grid(color="#9fb0c0", linewidth=0.4, alpha=0.5)
    figure.savefig(png_path, dpi=DPI)


def _scaled(cells: NDArray[np.int8]) -> tuple[NDArray[np.int8], float]:
    """The cells as pixels, and the pixels a cell; where cells share a pixel the most occupied one shows."""
    longest = max(cells.shape)
    if longest <= LONG_SIDE_PX:
        times = max(1, LONG_SIDE_PX // longest)
        return np.repeat(np.repeat(cells, times, axis=0), times, axis=1), float(times)
    share = -(-longest // LONG_SIDE_PX)
    padded = np.pad(cells, [(0, -size % share) for size in cells.shape], constant_values=np.int8(UNKNOWN))
    blocks = padded.reshape(padded.shape[0] // share, share, padded.shape[1] // share, share)
    return np.asarray(blocks.max(axis=(1, 3))), 1.0 / share


def _palette() -> NDArray[np.uint8]:
    """RGBA of 0 free ... 100 occupied, and of unknown at the end, where index -1 finds it."""
    paper, floor, wall = (_rgb(colour) for colour in (PAPER, FLOOR, WALL))
    share = np.linspace(0.0, 1.0, OCCUPIED - FREE + 1)[:, np.newaxis]
    rgb = np.vstack((floor + share * (wall - floor), paper))
    return np.asarray(np.rint(255.0 * np.column_stack((rgb, np.ones(len(rgb))))), dtype=np.uint8)


def _rgb(colour: str) -> FloatArray:
    return np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
