"""The simulated world: walls, boxes and posts in the plane of the lidar. The frame is `map`."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from thumper.common.geometry import FloatArray, Pose2
from thumper.maps.occupancy_grid import FREE, OCCUPIED, OccupancyGrid
from thumper_hil.effects.surfaces import GLASS_VISIBLE_RAD, Surface, SurfaceArray
from thumper_hil.world.echoes import Echoes
from thumper_hil.world.occupancy import SolidGrid
from thumper_hil.world.paint import PaintedBox
from thumper_hil.world.pedestrian import Pedestrian, TimedObstacle
from thumper_hil.world.segment_raycast import (
    GridGeometry,
    HitArray,
    cast_rays,
    mark_inside,
    mark_touched,
    polygon_clearance_m,
)
from thumper_hil.world.tag_shape import TagShape
from thumper_hil.world.world_file import WorldShapes, read_world_file

BORDER_M = 0.5
"""Margin of `to_grid` around the outermost wall."""

FAR_AWAY_M = 1e9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class World:
    """Segments, shape (n, 4): x0 y0 x1 y1 [m]; circles, shape (m, 3): x y radius [m].

    A box is stored as its four sides, and again as a polygon for `to_grid`, which fills its inside. `grid` is
    a map whose occupied cells are solid. `timed` and `walkers` describe what changes over time: this class
    only stores them, and `scene.Scene` simulates them.

    `segment_surfaces` and `circle_surfaces` hold the surface of the first segments and circles; all others
    are matt. The lidar sees `legs_m`, circles of walking people, but the robot does not stop at them
    (`scene.py`). It does stop at `overhangs_m`, segments that the lidar does not see, such as the edge of a
    low table top. `sills_m`, rows x0 y0 x1 y1 height, are seen by nobody; the wheels climb over them. Nor
    are `ramps_m` seen (`ramps.py`). Only the camera sees `tags`, and that the boxes in `painted` have a
    colour and end at a height; `boxes_m` and `segments_m` have them, too.
    """

    segments_m: FloatArray
    circles_m: FloatArray
    boxes_m: tuple[FloatArray, ...] = ()  # corners, shape (4, 2) each
    grid: SolidGrid | None = None
    timed: tuple[TimedObstacle, ...] = ()
    walkers: tuple[Pedestrian, ...] = ()
    segment_surfaces: SurfaceArray = field(default_factory=lambda: np.zeros(0, np.int8))
    circle_surfaces: SurfaceArray = field(default_factory=lambda: np.zeros(0, np.int8))
    legs_m: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    overhangs_m: FloatArray = field(default_factory=lambda: np.zeros((0, 4)))
    sills_m: FloatArray = field(default_factory=lambda: np.zeros((0, 5)))
    ramps_m: FloatArray = field(default_factory=lambda: np.zeros((0, 6)))
    tags: tuple[TagShape, ...] = ()
    painted: tuple[PaintedBox, ...] = ()

    @classmethod
    def load(cls, name_or_path: str | Path) -> Self:
        """Read `worlds/NAME.toml` of this package, a path that ends in `.toml`, or a map's `.yaml`.

        Raises
        ------
        ThumperError
            The world does not exist, or its file is invalid; the message names file and key.
        """
        if Path(name_or_path).suffix == ".yaml":
            grid = SolidGrid.load(Path(name_or_path))
            return cls(segments_m=np.zeros((0, 4)), circles_m=np.zeros((0, 3)), grid=grid)
        shapes = read_world_file(name_or_path)
        return cls.from_shapes(shapes)

    @classmethod
    def from_shapes(cls, shapes: WorldShapes, walkers: tuple[Pedestrian, ...] = ()) -> Self:
        """Return the world with the shapes of a file, and more people."""
        boxes = tuple(box_corners(*row) for row in shapes.boxes)
        return cls(
            segments_m=np.vstack([shapes.segments, *(box_sides(box) for box in boxes)]),
            circles_m=np.vstack([shapes.circles, *(table.legs_m() for table in shapes.tables)]),
            boxes_m=boxes,
            grid=SolidGrid.load(shapes.map_path) if shapes.map_path else None,
            timed=shapes.timed,
            walkers=shapes.walkers + walkers,
            segment_surfaces=np.array(
                [*shapes.segment_surfaces, *np.repeat(shapes.box_surfaces, 4)], dtype=np.int8
            ),
            circle_surfaces=np.array(shapes.circle_surfaces, np.int8),
            overhangs_m=np.vstack([np.zeros((0, 4)), *(table.edges_m() for table in shapes.tables)]),
            sills_m=np.array(shapes.sills, np.float64).reshape(-1, 5),
            ramps_m=np.array(shapes.ramps, np.float64).reshape(-1, 6),
            tags=shapes.tags,
            painted=tuple(
                PaintedBox(sides_m=box_sides(box), paint=paint)
                for box, paint in zip(boxes, shapes.box_paints, strict=False)
                if paint is not None
            ),
        )

    def cast(self, x_m: ArrayLike, y_m: ArrayLike, angles_rad: ArrayLike) -> FloatArray:
        """Return the distance [m] along each ray to its first hit, shape (n,), +inf for none.

        The three arguments broadcast to shape (n,): one origin for all rays, or one per ray.
        """
        x, y, angles = np.broadcast_arrays(
            np.asarray(x_m, np.float64), np.asarray(y_m, np.float64), np.atleast_1d(np.asarray(angles_rad))
        )
        origins_m = np.column_stack([x.ravel(), y.ravel()])
        return self._cast(origins_m, angles.astype(np.float64).ravel(), self.segments_m)[0]

    def cast_behind_painted(self, x_m: float, y_m: float, angles_rad: FloatArray) -> FloatArray:
        """Return what `cast` does, as if there were no coloured boxes, shape (n,)."""
        if not self.painted:
            return self.cast(x_m, y_m, angles_rad)
        sides_m = np.vstack([box.sides_m for box in self.painted])
        is_painted = (self.segments_m[:, None] == sides_m[None]).all(axis=2).any(axis=1)
        origins_m = np.tile((x_m, y_m), (angles_rad.size, 1))
        return self._cast(origins_m, angles_rad, self.segments_m[~is_painted])[0]

    def _cast(
        self, origins_m: FloatArray, angles_rad: FloatArray, segments_m: FloatArray
    ) -> tuple[FloatArray, HitArray]:
        """Return the distance along each ray and the index of the shape that it hits, -1 for none."""
        ranges_m, hit = np.empty(angles_rad.size), np.empty(angles_rad.size, np.int32)
        circles_m = np.vstack([self.circles_m, self.legs_m]) if self.legs_m.size else self.circles_m
        cast_rays(origins_m, angles_rad, segments_m, circles_m, ranges_m, hit)
        if self.grid is not None:
            shapes_m = ranges_m.copy()
            self.grid.cast(origins_m, angles_rad, ranges_m)
            hit[ranges_m < shapes_m] = -1
        return ranges_m, hit

    def echoes_at(
        self, times_s: FloatArray, x_m: FloatArray, y_m: FloatArray, angles_rad: FloatArray
    ) -> Echoes:
        """See `WorldAt`. The cells of a grid are matt and count as met along their normal."""
        origins_m = np.column_stack([x_m, y_m])
        echoes = self._echoes(origins_m, angles_rad, self.segments_m)
        through = (echoes.surface == Surface.GLASS) & (echoes.incidence_rad > GLASS_VISIBLE_RAD)
        if through.any():
            # Glass as a segment of length 0 far away keeps the indices of all other shapes.
            opaque_m = self.segments_m.copy()
            opaque_m[: self.segment_surfaces.size][self.segment_surfaces == Surface.GLASS] = FAR_AWAY_M
            behind = self._echoes(origins_m[through], angles_rad[through], opaque_m)
            echoes.put(through, behind)
        return echoes

    def _echoes(self, origins_m: FloatArray, angles_rad: FloatArray, segments_m: FloatArray) -> Echoes:
        ranges_m, hit = self._cast(origins_m, angles_rad, segments_m)
        surface, incidence_rad = np.zeros(hit.size, np.int8), np.zeros(hit.size)
        count = len(segments_m)
        on_segment, on_circle = (hit >= 0) & (hit < count), hit >= count
        walls = segments_m[hit[on_segment]]
        along_rad = np.arctan2(walls[:, 3] - walls[:, 1], walls[:, 2] - walls[:, 0])
        incidence_rad[on_segment] = np.arccos(np.abs(np.sin(angles_rad[on_segment] - along_rad)))
        known = np.concatenate(
            [
                _padded(self.segment_surfaces, count),
                _padded(self.circle_surfaces, len(self.circles_m) + len(self.legs_m)),
            ]
        )
        met = on_segment | on_circle
        surface[met] = known[hit[met]]
        return Echoes(ranges_m, surface, incidence_rad)

    def cast_at(
        self, times_s: FloatArray, x_m: FloatArray, y_m: FloatArray, angles_rad: FloatArray
    ) -> FloatArray:
        """Do the same as `cast` and ignore the times: this world is static."""
        return self.cast(x_m, y_m, angles_rad)

    def clearance_m(self, pose: Pose2, polygon_m: FloatArray) -> float:
        """Return the distance [m] from a body to the nearest obstacle, 0 on contact.

        `polygon_m`, shape (k, 2), is the outline in the body's frame; `pose` is its pose in the map. A body
        wholly inside a box counts as clear of it, because a body from outside touches a side first.
        """
        outline_m = pose.apply(polygon_m)
        segments_m = (
            np.vstack([self.segments_m, self.overhangs_m]) if self.overhangs_m.size else self.segments_m
        )
        clearance_m = polygon_clearance_m(outline_m, segments_m, self.circles_m)
        return min(clearance_m, self.grid.clearance_m(outline_m)) if self.grid is not None else clearance_m

    def touches(self, pose: Pose2, polygon_m: FloatArray) -> bool:
        """Return True if a body with this outline, shape (k, 2), touches anything at `pose`."""
        return self.clearance_m(pose, polygon_m) <= 0.0

    def to_grid(self, resolution_m: float = 0.05) -> OccupancyGrid:
        """Return the ground truth as a grid: a cell whose square contains anything is occupied."""
        x_lo, y_lo, x_hi, y_hi = self.bounds_m()
        origin_x, origin_y = (
            math.floor((low - BORDER_M) / resolution_m) * resolution_m for low in (x_lo, y_lo)
        )
        columns = math.ceil((x_hi + BORDER_M - origin_x) / resolution_m)
        rows = math.ceil((y_hi + BORDER_M - origin_y) / resolution_m)
        touched = np.zeros((rows, columns), np.bool_)
        geometry = GridGeometry(resolution_m, origin_x, origin_y)
        mark_touched(geometry, self.segments_m, self.circles_m, touched)
        for box_m in self.boxes_m:
            mark_inside(geometry, box_m, touched)
        if self.grid is not None:
            x_m = np.asarray(origin_x + (np.arange(columns) + 0.5) * resolution_m, np.float64)
            y_m = np.asarray(origin_y + (np.arange(rows) + 0.5) * resolution_m, np.float64)
            self.grid.mark(x_m, y_m, touched)
        cells = np.where(touched, OCCUPIED, FREE).astype(np.int8)
        return OccupancyGrid(cells=cells, resolution_m=resolution_m, origin_x_m=origin_x, origin_y_m=origin_y)

    def bounds_m(self) -> tuple[float, float, float, float]:
        """Return (x_min, y_min, x_max, y_max) of everything."""
        points = np.vstack(
            [
                self.segments_m[:, :2],
                self.segments_m[:, 2:],
                self.circles_m[:, :2] - self.circles_m[:, 2:],
                self.circles_m[:, :2] + self.circles_m[:, 2:],
                np.zeros((0, 2)) if self.grid is None else np.reshape(self.grid.bounds_m(), (2, 2)),
            ]
        )
        (x_lo, y_lo), (x_hi, y_hi) = points.min(axis=0), points.max(axis=0)
        return float(x_lo), float(y_lo), float(x_hi), float(y_hi)


def _padded(surfaces: SurfaceArray, count: int) -> SurfaceArray:
    """Return the surfaces of `count` shapes: those given, then matt."""
    return np.concatenate([surfaces, np.zeros(count - surfaces.size, np.int8)])


def box_sides(corners_m: FloatArray) -> FloatArray:
    """Return the four sides, shape (4, 4), of a box with these corners, shape (4, 2)."""
    return np.column_stack([corners_m, np.roll(corners_m, -1, axis=0)])


def box_corners(x_m: float, y_m: float, length_m: float, width_m: float, yaw_deg: float) -> FloatArray:
    """Return the corners, shape (4, 2), of a box around its centre."""
    half = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (length_m, width_m)
    return Pose2(x_m=x_m, y_m=y_m, theta_rad=math.radians(yaw_deg)).apply(half)
