"""A map as a world: the occupied cells of a PGM and YAML map are solid, all others are free."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.maps.map_server_io import load_map
from thumper_hil.world.grid_raycast import StepArray, cast_grid, grid_clearance_m
from thumper_hil.world.segment_raycast import BoolArray, GridGeometry

MAX_CLEARANCE_M = 0.5
SOLID_PERCENT = 65


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SolidGrid:
    """Solid cells, shape (rows, columns), with row 0 at y_lo_m and column 0 at x_lo_m."""

    solid: BoolArray
    resolution_m: float
    x_lo_m: float
    y_lo_m: float
    distance: StepArray = field(init=False)  # chessboard distance of each cell to the nearest solid cell

    def __post_init__(self) -> None:
        if self.solid.any():
            from scipy.ndimage import distance_transform_cdt  # 0.2 s to load; most worlds have no cells

            distance = distance_transform_cdt(~self.solid, metric="chessboard").astype(np.int32)
        else:
            distance = np.full(self.solid.shape, max(self.solid.shape), np.int32)
        object.__setattr__(self, "distance", distance)

    @classmethod
    def load(cls, yaml_path: Path) -> "SolidGrid":
        """Read a map in map_server format; raise ThumperError that names the file and the problem."""
        grid = load_map(yaml_path)
        return cls(
            solid=np.ascontiguousarray(grid.cells >= SOLID_PERCENT),
            resolution_m=grid.resolution_m,
            x_lo_m=grid.origin_x_m,
            y_lo_m=grid.origin_y_m,
        )

    def cast(self, origins_m: FloatArray, angles_rad: FloatArray, ranges_m: FloatArray) -> None:
        """Lower `ranges_m`, shape (n,), to where rays from `origins_m`, shape (n, 2), hit a solid cell."""
        cast_grid(origins_m, angles_rad, self.distance, self._geometry(), ranges_m)

    def clearance_m(self, polygon_m: FloatArray) -> float:
        """Return the distance [m] from a polygon, shape (k, 2), to the nearest solid cell, at most 0.5 m."""
        return grid_clearance_m(polygon_m, self.solid, self._geometry(), MAX_CLEARANCE_M)

    def _geometry(self) -> GridGeometry:
        return GridGeometry(self.resolution_m, self.x_lo_m, self.y_lo_m)

    def mark(self, x_m: FloatArray, y_m: FloatArray, touched: BoolArray) -> None:
        """Set the cells of `touched`, shape (len(y_m), len(x_m)), whose centres lie in a solid cell."""
        columns = np.floor((x_m - self.x_lo_m) / self.resolution_m).astype(int)
        rows = np.floor((y_m - self.y_lo_m) / self.resolution_m).astype(int)
        known_x = (columns >= 0) & (columns < self.solid.shape[1])
        known_y = (rows >= 0) & (rows < self.solid.shape[0])
        touched[np.ix_(known_y, known_x)] |= self.solid[np.ix_(rows[known_y], columns[known_x])]

    def bounds_m(self) -> tuple[float, float, float, float]:
        """Return (x_min, y_min, x_max, y_max) of the whole map."""
        rows, columns = self.solid.shape
        return (
            self.x_lo_m,
            self.y_lo_m,
            self.x_lo_m + columns * self.resolution_m,
            self.y_lo_m + rows * self.resolution_m,
        )
