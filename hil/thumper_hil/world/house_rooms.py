"""Rooms of a random house: outer walls with a glass door, inner walls with door openings, sills."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_hil.effects.surfaces import Surface

Box = tuple[float, float, float, float, float]
WALL_M = 0.1
DOOR_M = (0.8, 0.95)
GLASS_M = 1.2
SILL_SHARE = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Rooms:
    """Walls as outer segments and inner boxes, and each room's inside (x0, y0, x1, y1)."""

    outer: FloatArray
    outer_surfaces: tuple[int, ...]
    walls: tuple[Box, ...]
    sills: tuple[tuple[float, ...], ...]
    areas: tuple[tuple[float, float, float, float], ...]

    def room_of(self, point_m: FloatArray) -> int:
        """Return the number of the room that contains a point, -1 in a doorway."""
        for number, (x0, y0, x1, y1) in enumerate(self.areas):
            if x0 <= point_m[0] <= x1 and y0 <= point_m[1] <= y1:
                return number
        return -1


def make_rooms(rng: np.random.Generator) -> Rooms:
    """Return two to six rooms in a grid; neighbours share a door."""
    xs = np.concatenate([[0.0], np.cumsum(rng.uniform(2.8, 4.2, int(rng.integers(2, 4))))])
    ys = np.concatenate([[0.0], np.cumsum(rng.uniform(2.8, 4.0, int(rng.integers(1, 3))))])
    walls: list[Box] = []
    sills: list[tuple[float, ...]] = []
    for x in xs[1:-1]:
        for low, high in pairwise(ys):
            for a, b in _around_door(low, high, rng):
                walls.append((float(x), 0.5 * (a + b), WALL_M, b - a, 0.0))
            if rng.random() < SILL_SHARE:
                sills.append((float(x), float(low), float(x), float(high), 0.015))
    for y in ys[1:-1]:
        for low, high in pairwise(xs):
            for a, b in _around_door(low, high, rng):
                walls.append((0.5 * (a + b), float(y), b - a, WALL_M, 0.0))
    outer, surfaces = _outer(float(xs[-1]), float(ys[-1]), float(xs[1]), rng)
    margin = 0.5 * WALL_M
    areas = tuple(
        (float(x0) + margin, float(y0) + margin, float(x1) - margin, float(y1) - margin)
        for x0, x1 in pairwise(xs)
        for y0, y1 in pairwise(ys)
    )
    return Rooms(outer=outer, outer_surfaces=surfaces, walls=tuple(walls), sills=tuple(sills), areas=areas)


def _around_door(low: float, high: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Return the two pieces of a wall beside its door."""
    width_m = rng.uniform(*DOOR_M)
    start_m = rng.uniform(low + 0.3, high - 0.3 - width_m)
    return [(float(low), float(start_m)), (float(start_m + width_m), float(high))]


def _outer(
    width_m: float, height_m: float, first_m: float, rng: np.random.Generator
) -> tuple[FloatArray, tuple[int, ...]]:
    """Return the outer wall as a ring; every third house has a glass door in its south wall."""
    points = [(0.0, 0.0), (width_m, 0.0), (width_m, height_m), (0.0, height_m)]
    surfaces = [0, 0, 0, 0]
    if rng.random() < 1.0 / 3.0:
        start_m = float(rng.uniform(0.4, first_m - GLASS_M - 0.4))
        points[1:1] = [(start_m, 0.0), (start_m + GLASS_M, 0.0)]
        surfaces = [0, int(Surface.GLASS), 0, 0, 0, 0]
    ring = [(*a, *b) for a, b in pairwise([*points, points[0]])]
    return np.array(ring, np.float64), tuple(surfaces)
