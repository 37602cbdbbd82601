"""Draw maps, and paths in them, as pictures."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from thumper.common.colours import BLUE, FREE_COLOUR, OCCUPIED_COLOUR, ORANGE, PURPLE, UNKNOWN_COLOUR
from thumper.common.files import write_whole
from thumper.common.geometry import FloatArray
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

LONG_SIDE_PX, BORDER_PX, BOTTOM_PX, DPI = 1200, 90, 54, 120
MARGIN_M = 0.5
LEGEND: dict[str, Any] = {
    "loc": "lower center",
    "bbox_to_anchor": (0.5, 1.0),
    "frameon": False,
    "fontsize": 9,
}
TITLE_ABOVE_LEGEND_PT = 22
_ZONE = to_rgba(PURPLE, 0.3)


class _Image(NamedTuple):
    """The known part of a map: pixels, shape (height, width), and what they cover [m]."""

    pixels: NDArray[np.int8]
    left_m: float
    right_m: float
    bottom_m: float
    top_m: float


def draw_grid(axes: Axes, grid: OccupancyGrid) -> None:
    """Draw the known part of the map; axes in metres, with equal scales."""
    image = _known_part(grid)
    axes.imshow(
        _palette()[np.clip(image.pixels, UNKNOWN, OCCUPIED)],
        origin="lower",
        interpolation="nearest",
        extent=(image.left_m, image.right_m, image.bottom_m, image.top_m),
    )
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")


def plot_map(
    grid: OccupancyGrid,
    path_m: FloatArray,
    png_path: Path,
    title: str,
    *,
    planned: bool = False,
    keepout: NDArray[np.bool_] | None = None,
) -> None:
    """Write a PNG of the known part of the map and the path, shape (n, 2) [m].

    As in the other pictures, a planned path is orange, a driven one blue. `keepout` marks the cells of the
    grid that are in keep-out zones.
    """
    height, width = _known_part(grid).pixels.shape
    scale = max(1, LONG_SIDE_PX // max(height, width))  # whole pixels per cell: all cells look the same
    height_px, width_px = scale * height, scale * width
    size_px = np.array([width_px + 1.3 * BORDER_PX, height_px + 1.3 * BORDER_PX])
    figure = Figure(figsize=tuple(size_px / DPI), dpi=DPI)
    FigureCanvasAgg(figure)  # draws without a display
    axes = figure.add_axes(
        (BORDER_PX / size_px[0], BOTTOM_PX / size_px[1], width_px / size_px[0], height_px / size_px[1])
    )
    draw_grid(axes, grid)
    if path_m.shape[0]:
        colour, last = (ORANGE, "goal") if planned else (BLUE, "end")
        axes.plot(path_m[:, 0], path_m[:, 1], color=colour, linewidth=1.0, alpha=0.85, label="path")
        axes.plot(*path_m[0], "o", color=colour, markersize=7, markerfacecolor="white", label="start")
        axes.plot(*path_m[-1], "o", color=colour, markersize=7, label=last)
    zones = []
    if keepout is not None and keepout.any():
        _draw_zones(axes, grid, keepout)
        zones = [Patch(color=_ZONE, label="keep-out zone")]
    handles = axes.get_legend_handles_labels()[0] + zones
    if handles:
        axes.legend(handles=handles, ncols=len(handles), **LEGEND)
    axes.set_title(title, pad=TITLE_ABOVE_LEGEND_PT if handles else None)
    axes.grid(color="#9fb0c0", linewidth=0.4, alpha=0.5)
    save_figure(figure, png_path, DPI)


def _draw_zones(axes: Axes, grid: OccupancyGrid, keepout: NDArray[np.bool_]) -> None:
    """Colour the keep-out zones, but no wall; the axes keep their limits."""
    axes.autoscale(False)
    height_m, width_m = (size * grid.resolution_m for size in keepout.shape)
    axes.imshow(
        np.where((keepout & (grid.cells < OCCUPIED))[..., np.newaxis], _ZONE, 0.0),
        origin="lower",
        interpolation="nearest",
        extent=(grid.origin_x_m, grid.origin_x_m + width_m, grid.origin_y_m, grid.origin_y_m + height_m),
    )


def save_figure(figure: Figure, png_path: Path, dpi: int) -> None:
    """Write a figure as PNG, whole. Raises ThumperError if it cannot be written."""
    with write_whole(png_path) as stream:
        figure.savefig(stream, format="png", dpi=dpi)


def _known_part(grid: OccupancyGrid) -> _Image:
    """Crop to the known cells and a margin; in a large map several cells share a pixel."""
    grid = grid.with_a_cell()
    known = np.argwhere(grid.cells != UNKNOWN)
    margin = max(4, round(MARGIN_M / grid.resolution_m))
    rows, cols = grid.cells.shape
    low = np.maximum(known.min(axis=0) - margin, 0) if known.size else np.zeros(2, dtype=int)
    high = np.minimum(known.max(axis=0) + margin + 1, (rows, cols)) if known.size else np.array([rows, cols])
    cells = grid.cells[low[0] : high[0], low[1] : high[1]]
    block = -(-max(cells.shape) // LONG_SIDE_PX)  # cells per pixel
    pixels = _reduce(cells, block)
    pixel_m = block * grid.resolution_m
    left_m = grid.origin_x_m + low[1] * grid.resolution_m
    bottom_m = grid.origin_y_m + low[0] * grid.resolution_m
    height, width = pixels.shape
    return _Image(pixels, left_m, left_m + width * pixel_m, bottom_m, bottom_m + height * pixel_m)


def _reduce(cells: NDArray[np.int8], block: int) -> NDArray[np.int8]:
    """Return the most occupied cell of each block of `block` x `block` cells."""
    padded = np.pad(cells, [(0, -size % block) for size in cells.shape], constant_values=np.int8(UNKNOWN))
    blocks = padded.reshape(padded.shape[0] // block, block, padded.shape[1] // block, block)
    return np.asarray(blocks.max(axis=(1, 3)))


def _palette() -> NDArray[np.uint8]:
    """Return the RGBA colours of 0 free ... 100 occupied, then of unknown, which is index -1."""
    unknown, free, occupied = (_rgb(colour) for colour in (UNKNOWN_COLOUR, FREE_COLOUR, OCCUPIED_COLOUR))
    share = np.linspace(0.0, 1.0, OCCUPIED - FREE + 1)[:, np.newaxis]
    rgb = np.vstack((free + share * (occupied - free), unknown))
    return np.asarray(np.rint(255.0 * np.column_stack((rgb, np.ones(len(rgb))))), dtype=np.uint8)


def _rgb(colour: str) -> FloatArray:
    return np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
