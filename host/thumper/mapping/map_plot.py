"""A picture of a map and the way through it, for people."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from thumper.geometry import FloatArray
from thumper.mapping.grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

PAPER, FLOOR, WALL, WAY = "#e9edf1", "#ffffff", "#1c2733", "#d1495b"


def plot_map(grid: OccupancyGrid, path_m: FloatArray, png_path: Path, title: str) -> None:
    """Write a PNG of the known part of the map and the path, shape (n, 2), axes in metres."""
    known = np.argwhere(grid.cells != UNKNOWN)
    margin = max(4, round(0.5 / grid.resolution_m))
    rows, cols = grid.cells.shape
    low = np.maximum(known.min(axis=0) - margin, 0) if known.size else np.zeros(2, dtype=int)
    high = np.minimum(known.max(axis=0) + margin + 1, (rows, cols)) if known.size else np.array([rows, cols])
    cells = grid.cells[low[0] : high[0], low[1] : high[1]]
    extent = (
        grid.origin_x_m + low[1] * grid.resolution_m,
        grid.origin_x_m + high[1] * grid.resolution_m,
        grid.origin_y_m + low[0] * grid.resolution_m,
        grid.origin_y_m + high[0] * grid.resolution_m,
    )
    width_in = 9.0
    height_in = float(np.clip(width_in * cells.shape[0] / cells.shape[1], 3.0, 14.0)) + 0.8
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)  # draws without a display
    axes = figure.subplots()
    axes.imshow(_colours(cells), origin="lower", extent=extent, interpolation="nearest")
    if path_m.shape[0]:
        axes.plot(path_m[:, 0], path_m[:, 1], color=WAY, linewidth=1.0, alpha=0.85, label="path")
        axes.plot(*path_m[0], "o", color=WAY, markersize=7, markerfacecolor="white", label="start")
        axes.plot(*path_m[-1], "o", color=WAY, markersize=7, label="end")
        axes.legend(loc="upper right", frameon=True, framealpha=0.9)
    axes.set(title=title, xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.grid(color="#9fb0c0", linewidth=0.4, alpha=0.5)
    figure.savefig(png_path, dpi=150)


def _colours(cells: np.ndarray[tuple[int, int], np.dtype[np.int8]]) -> FloatArray:
    """Cells as RGB, shape (rows, columns, 3): unknown, free to occupied in shades between."""
    paper, floor, wall = (_rgb(colour) for colour in (PAPER, FLOOR, WALL))
    share = np.clip((cells.astype(np.float64) - FREE) / (OCCUPIED - FREE), 0.0, 1.0)[..., np.newaxis]
    return np.asarray(np.where((cells == UNKNOWN)[..., np.newaxis], paper, floor + share * (wall - floor)))


def _rgb(colour: str) -> FloatArray:
    return np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
