"""Random furnished houses for campaigns: rooms with doors, furniture, glass, sills and people, by seed.

`World.load("house-17")` is house number 17. `house_mission(17)` adds a start and a goal that a robot with a
circumscribed radius of 0.26 m can reach without touching anything. It starts with free floor ahead, as a user
would place it: the lidar has not seen what is behind it, so it can neither turn in place nor back up there.
"""

import math
import re
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.maps.occupancy_grid import OCCUPIED
from thumper_hil.effects.surfaces import Surface
from thumper_hil.world.furniture import Furniture
from thumper_hil.world.house_rooms import Box, Rooms, make_rooms
from thumper_hil.world.pedestrian import Pedestrian
from thumper_hil.world.world import World
from thumper_hil.world.world_file import WorldShapes

CELL_M = 0.05
CLEARANCE_M = 0.32
"""Start, goal and the way between them keep this distance from everything: the doors are 0.8 m wide."""

MIN_DISTANCE_M = 2.5
AHEAD_M, AHEAD_RAD = 0.9, 0.5  # free in front of the start, and to each side of that direction
ATTEMPTS = 50
LEGS = 4  # of a table or chair
SURFACES = (Surface.MATT, Surface.DARK, Surface.SHINY)


@dataclass(frozen=True, slots=True, kw_only=True)
class HouseMission:
    """A house, where the robot starts, and where it goes."""

    world: World
    start: Pose2
    goal_m: tuple[float, float]


def house_number(world: str) -> int | None:
    """Return 17 for `house-17`, None for the name of another world."""
    found = re.fullmatch(r"house-(\d{1,9})", world)
    return int(found[1]) if found else None


@lru_cache(maxsize=4)
def house_mission(number: int) -> HouseMission:
    """Return house `number`, always the same."""
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([number, attempt, 0x405E])
        mission = _attempt(rng)
        if mission is not None:
            return mission
    raise AssertionError(f"house {number}: no mission in {ATTEMPTS} attempts")


def with_dark_legs(world: World, share: float, number: int) -> World:
    """Return the world of house `number`; this share of its tables and chairs has four dark legs each."""
    rng = np.random.default_rng([number, 0xDA2C])
    is_dark = rng.random(len(world.circles_m) // LEGS) < share
    surfaces = np.where(is_dark, Surface.DARK, Surface.MATT).astype(np.int8)
    return replace(world, circle_surfaces=np.repeat(surfaces, LEGS))


def is_carpeted(share: float, number: int) -> bool:
    """Return whether house `number` lies on carpet; this share of the houses does."""
    return bool(np.random.default_rng([number, 0xCA29]).random() < share)


def _attempt(rng: np.random.Generator) -> HouseMission | None:
    rooms = make_rooms(rng)
    boxes, tables, surfaces = _furniture(rooms, rng)
    shapes = WorldShapes(
        segments=rooms.outer,
        circles=np.zeros((0, 3)),
        boxes=(*rooms.walls, *boxes),
        tables=tables,
        sills=rooms.sills,
        segment_surfaces=rooms.outer_surfaces,
        box_surfaces=(*(0 for _ in rooms.walls), *surfaces),
    )
    world = World.from_shapes(shapes)
    free = _free_points(world)
    if len(free) < 100:
        return None
    for _ in range(ATTEMPTS):
        start_m, goal_m = free[rng.integers(len(free), size=2)]
        if rooms.room_of(start_m) != rooms.room_of(goal_m) and math.dist(start_m, goal_m) > MIN_DISTANCE_M:
            start_m, goal_m = (np.round(point_m, 3) for point_m in (start_m, goal_m))
            start = _start(world, start_m, rng)
            if start is None:
                continue
            walkers = _people(world, free, start_m, rng)
            return HouseMission(
                world=World.from_shapes(shapes, walkers),
                start=start,
                goal_m=(float(goal_m[0]), float(goal_m[1])),
            )
    return None


def _start(world: World, start_m: FloatArray, rng: np.random.Generator) -> Pose2 | None:
    """Return the start with a random heading that has free floor ahead, None if the draws find none."""
    spread_rad = np.linspace(-AHEAD_RAD, AHEAD_RAD, 21)
    for heading_rad in rng.uniform(-math.pi, math.pi, ATTEMPTS):
        if world.cast(start_m[0], start_m[1], heading_rad + spread_rad).min() > AHEAD_M:
            return Pose2(x_m=float(start_m[0]), y_m=float(start_m[1]), theta_rad=float(heading_rad))
    return None


def _free_points(world: World) -> FloatArray:
    """Return the points of the largest connected area in which the robot can turn, shape (n, 2)."""
    from scipy.ndimage import distance_transform_edt, label  # 0.2 s to load; most worlds are no houses

    grid = world.to_grid(CELL_M)
    blocked: NDArray[np.bool_] = grid.cells == OCCUPIED
    parts, _ = label(distance_transform_edt(~blocked) * CELL_M > CLEARANCE_M)
    x_lo, y_lo, x_hi, y_hi = world.bounds_m()
    rows, columns = np.nonzero(parts)
    points_m = np.column_stack([columns, rows]) * CELL_M + (
        grid.origin_x_m + 0.5 * CELL_M,
        grid.origin_y_m + 0.5 * CELL_M,
    )
    inside = ((points_m > (x_lo, y_lo)) & (points_m < (x_hi, y_hi))).all(axis=1)
    names = parts[rows, columns]
    sizes = np.bincount(names[inside], minlength=1)
    chosen: FloatArray = points_m[inside & (names == int(np.argmax(sizes)))]
    return chosen


def _furniture(
    rooms: Rooms, rng: np.random.Generator
) -> tuple[tuple[Box, ...], tuple[Furniture, ...], tuple[int, ...]]:
    """Return cupboards and sofas along the walls with their surfaces, and tables with chairs."""
    boxes: list[Box] = []
    tables: list[Furniture] = []
    surfaces: list[int] = []
    for x0, y0, x1, y1 in rooms.areas:
        for _ in range(int(rng.integers(0, 3))):
            length_m, depth_m = rng.uniform(0.6, 1.6), rng.uniform(0.35, 0.8)
            x_m = rng.uniform(x0 + 0.5 * length_m, x1 - 0.5 * length_m)
            y_m = rng.choice((y0 + 0.5 * depth_m + 0.02, y1 - 0.5 * depth_m - 0.02))
            boxes.append((float(x_m), float(y_m), float(length_m), float(depth_m), 0.0))
            surfaces.append(int(rng.choice(SURFACES, p=(0.6, 0.25, 0.15))))
        if rng.random() < 0.6:
            tables += _dining_set(x0, y0, x1, y1, rng)
    return tuple(boxes), tuple(tables), tuple(surfaces)


def _dining_set(x0: float, y0: float, x1: float, y1: float, rng: np.random.Generator) -> list[Furniture]:
    centre = Pose2(
        x_m=float(rng.uniform(x0 + 1.0, x1 - 1.0)),
        y_m=float(rng.uniform(y0 + 1.0, y1 - 1.0)),
        theta_rad=float(rng.uniform(-math.pi, math.pi)),
    )
    yaw_deg = math.degrees(centre.theta_rad)
    found = [
        Furniture(
            x_m=centre.x_m, y_m=centre.y_m, length_m=1.2, width_m=0.7, yaw_deg=yaw_deg, leg_radius_m=0.025
        )
    ]  # fmt: skip
    for side, along in product((-1.0, 1.0), (-0.3, 0.3)):
        if rng.random() < 0.6:
            at = centre @ Pose2(x_m=along, y_m=side * rng.uniform(0.35, 0.6))
            found.append(
                Furniture(
                    x_m=at.x_m, y_m=at.y_m, length_m=0.4, width_m=0.4,
                    yaw_deg=yaw_deg + float(rng.uniform(-20.0, 20.0)),
                    leg_radius_m=0.015, clearance_m=0.45,
                )
            )  # fmt: skip
    return found


def _people(
    world: World, free_m: FloatArray, start_m: FloatArray, rng: np.random.Generator
) -> tuple[Pedestrian, ...]:
    """Return at most one person, who walks between two points in sight of each other."""
    if rng.random() < 0.5:
        return ()
    for _ in range(ATTEMPTS):
        a_m, b_m = free_m[rng.integers(len(free_m), size=2)]
        length_m = math.dist(a_m, b_m)
        angle_rad = math.atan2(b_m[1] - a_m[1], b_m[0] - a_m[0])
        in_sight = length_m > 1.5 and world.cast(a_m[0], a_m[1], angle_rad)[0] > length_m + CLEARANCE_M
        if in_sight and math.dist(a_m, start_m) > 1.0:
            return (
                Pedestrian(
                    waypoints_m=np.array([a_m, b_m]),
                    speed_m_s=float(rng.uniform(0.4, 1.0)),
                    radius_m=0.2,
                    leg_radius_m=0.06,
                    from_s=float(rng.uniform(2.0, 10.0)),
                ),
            )
    return ()
