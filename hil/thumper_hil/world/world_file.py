"""Read a world's TOML: walls, boxes, circles, a map, people. Unknown keys are errors."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray
from thumper.common.texts import choice_hint
from thumper.common.toml_file import load_toml
from thumper_hil.effects.surfaces import Surface
from thumper_hil.world.furniture import Furniture
from thumper_hil.world.paint import Paint
from thumper_hil.world.pedestrian import Pedestrian, TimedObstacle
from thumper_hil.world.tag_shape import TagShape

WORLDS = Path(__file__).resolve().parent.parent / "worlds"

TITLES = {  # of the built-in worlds, for lists
    "charging": "Charging dock: the laboratory with a dock at its west wall",
    "hall": "Hall: empty, 14 x 6 m",
    "lab": "Laboratory: one room of 4.8 x 3.8 m",
    "lab_box": "Laboratory with a box in the way",
    "passage": "Narrow passages: three rooms, two gaps of 0.40 m",
    "people": "People: a hall of 7 x 4 m, two of them cross it",
    "ramp": "Ramp: two rooms, 6 % up to the second",
    "yard": "Yard: 34 x 24 m outdoors, for GPS",
}

WALL_KEYS = frozenset({"name", "points_m", "closed", "surface"})
TIME_KEYS = frozenset({"from_s", "until_s"})
RECTANGLE_KEYS = frozenset({"name", "x_m", "y_m", "length_m", "width_m", "yaw_deg"})
PAINT_KEYS = frozenset({"colour", "height_m"})
BOX_KEYS = RECTANGLE_KEYS | TIME_KEYS | PAINT_KEYS | {"surface"}
CIRCLE_KEYS = frozenset({"name", "x_m", "y_m", "radius_m", "surface"}) | TIME_KEYS
PERSON_KEYS = frozenset({"name", "waypoints_m", "speed_m_s", "radius_m", "leg_radius_m", "from_s", "returns"})
TABLE_KEYS = {
    "wall": WALL_KEYS,
    "box": BOX_KEYS,
    "circle": CIRCLE_KEYS,
    "person": PERSON_KEYS,
    "table": RECTANGLE_KEYS | {"leg_radius_m", "clearance_m"},
    "sill": frozenset({"name", "points_m", "height_m"}),
    "ramp": RECTANGLE_KEYS | {"rise_m"},
    "tag": frozenset({"name", "id", "x_m", "y_m", "z_m", "yaw_deg", "size_m"}),
}
SURFACES = {surface.name.lower(): surface for surface in Surface}
MAX_BASES = 8
PERSON_RADIUS_M = 0.2
PERSON_SPEED_M_S = 0.8
TABLE_LEG_RADIUS_M = 0.02
TABLE_CLEARANCE_M = 0.7
SILL_HEIGHT_M = 0.015
STEEPEST_RAMP = 0.3  # rise over length; loss of grip and tipping on a slope are not modelled
BOX_HEIGHT_M = 0.5  # of a coloured box
TAG_HEIGHT_M, TAG_SIZE_M, TAGS_IN_FAMILY = 0.20, 0.10, 587


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WorldShapes:
    """Content of a world file: wall segments (n, 4), circles (m, 3), boxes (x, y, length, width, yaw_deg)."""

    segments: FloatArray
    circles: FloatArray
    boxes: tuple[tuple[float, float, float, float, float], ...]
    timed: tuple[TimedObstacle, ...] = ()
    walkers: tuple[Pedestrian, ...] = ()
    tables: tuple[Furniture, ...] = ()
    sills: tuple[tuple[float, ...], ...] = ()  # x0, y0, x1, y1, height
    ramps: tuple[tuple[float, ...], ...] = ()  # x, y, length, width, yaw_deg, rise
    segment_surfaces: tuple[int, ...] = ()
    box_surfaces: tuple[int, ...] = ()
    circle_surfaces: tuple[int, ...] = ()
    tags: tuple[TagShape, ...] = ()
    box_paints: tuple[Paint | None, ...] = ()  # of the first boxes
    map_path: Path | None = None


class _BadWorldError(ValueError):
    """An invalid key or value; the caller adds the file name."""


def read_world_file(name_or_path: str | Path) -> WorldShapes:
    """Read `worlds/NAME.toml`, or a path that ends in `.toml`, together with its `base` world.

    Raises
    ------
    ThumperError
        The world does not exist, or its file is invalid; the message names file and key.
    """
    given = Path(name_or_path)
    path = given if given.suffix == ".toml" else WORLDS / f"{given}.toml"
    return _read(path, parents=())


def world_names() -> list[str]:
    """Return the names of the built-in world files."""
    return sorted(file.stem for file in WORLDS.glob("*.toml"))


def suggested_worlds() -> list[str]:
    """Return the names that lists and Tab offer: the built-in worlds and the first houses."""
    return [*world_names(), *(f"house-{number}" for number in range(1, 10))]


def world_titles() -> dict[str, str]:
    """Return the titles of the suggested worlds; before a colon stands the short one."""
    return {name: TITLES.get(name) or f"House {name[6:]}: furnished rooms" for name in suggested_worlds()}


def _read(path: Path, parents: tuple[Path, ...]) -> WorldShapes:
    if path.resolve() in parents:
        raise ThumperError(
            f"{path}: base: the world includes itself; name another world", exit_code=EXIT_USAGE
        )
    if len(parents) > MAX_BASES:
        raise ThumperError(
            f"{path}: base: more than {MAX_BASES} worlds, each on top of the next; join some of them",
            exit_code=EXIT_USAGE,
        )
    try:
        data = load_toml(path)
    except FileNotFoundError as error:
        name = path.stem if path.parent == WORLDS else str(path)
        hint = choice_hint(name, (*world_names(), "house-1", "house-2", "..."))
        raise ThumperError(f"{name}: unknown world; {hint}", exit_code=EXIT_USAGE) from error
    except (OSError, ValueError) as error:
        raise ThumperError(f"{path}: cannot read the world: {error}", exit_code=EXIT_USAGE) from error
    try:
        own = _parse(data, path.parent)
    except _BadWorldError as error:
        raise ThumperError(f"{path}: {error}", exit_code=EXIT_USAGE) from error
    if "base" not in data:
        return own
    base = _read(path.parent / f"{data['base']}.toml", (*parents, path.resolve()))
    return WorldShapes(
        segments=np.vstack([base.segments, own.segments]),
        circles=np.vstack([base.circles, own.circles]),
        boxes=base.boxes + own.boxes,
        timed=base.timed + own.timed,
        walkers=base.walkers + own.walkers,
        tables=base.tables + own.tables,
        sills=base.sills + own.sills,
        ramps=base.ramps + own.ramps,
        segment_surfaces=base.segment_surfaces + own.segment_surfaces,
        box_surfaces=base.box_surfaces + own.box_surfaces,
        circle_surfaces=base.circle_surfaces + own.circle_surfaces,
        tags=base.tags + own.tags,
        box_paints=base.box_paints + own.box_paints,
        map_path=own.map_path or base.map_path,
    )


def _parse(data: dict[str, Any], folder: Path) -> WorldShapes:
    _refuse_unknown(data, frozenset(TABLE_KEYS) | {"base", "description", "map"}, "")
    for key in ("base", "description", "map"):
        if not isinstance(data.get(key, ""), str):
            raise _BadWorldError(f"{key} = {data[key]!r}: must be a string")
    segments, segment_surfaces, box_surfaces, circle_surfaces = [], [], [], []
    for where, wall in _tables(data, "wall"):
        sides = list(_wall_segments(where, wall))
        segments += sides
        segment_surfaces += [_surface(where, wall)] * len(sides)
    boxes, box_paints, circles, timed = [], [], [], []
    for where, table in _tables(data, "box"):
        box = _box(where, table)
        if TIME_KEYS & table.keys():
            if PAINT_KEYS & table.keys():
                raise _BadWorldError(f"{where}colour: a box that comes or goes has none; remove it")
            timed.append(_timed(where, table, TimedObstacle(box=box)))
        else:
            boxes.append(box)
            box_paints.append(_paint(where, table))
            box_surfaces.append(_surface(where, table))
    for where, table in _tables(data, "circle"):
        circle = (
            _number(table, "x_m", where), _number(table, "y_m", where), _positive(table, "radius_m", where)
        )  # fmt: skip
        if TIME_KEYS & table.keys():
            timed.append(_timed(where, table, TimedObstacle(circle=circle)))
        else:
            circles.append(circle)
            circle_surfaces.append(_surface(where, table))
    walkers = tuple(_person(where, table) for where, table in _tables(data, "person"))
    tables = tuple(_table(where, table) for where, table in _tables(data, "table"))
    if not (segments or boxes or circles or timed or walkers or tables or {"base", "map"} & data.keys()):
        raise _BadWorldError("the world is empty; add a [[wall]], [[box]] or [[circle]], or a map")
    return WorldShapes(
        segments=np.array(segments, np.float64).reshape(-1, 4),
        circles=np.array(circles, np.float64).reshape(-1, 3),
        boxes=tuple(boxes),
        timed=tuple(timed),
        walkers=walkers,
        tables=tables,
        sills=tuple(sill for where, table in _tables(data, "sill") for sill in _sills(where, table)),
        ramps=tuple(_ramp(where, table) for where, table in _tables(data, "ramp")),
        segment_surfaces=tuple(segment_surfaces),
        box_surfaces=tuple(box_surfaces),
        circle_surfaces=tuple(circle_surfaces),
        box_paints=tuple(box_paints),
        tags=tuple(_tag(where, table) for where, table in _tables(data, "tag")),
        map_path=folder / data["map"] if "map" in data else None,
    )


def _box(where: str, table: dict[str, Any]) -> tuple[float, float, float, float, float]:
    return (
        _number(table, "x_m", where),
        _number(table, "y_m", where),
        _positive(table, "length_m", where),
        _positive(table, "width_m", where),
        _number({"yaw_deg": 0.0, **table}, "yaw_deg", where),
    )


def _paint(where: str, table: dict[str, Any]) -> Paint | None:
    """Return colour and height of a box; None if it looks like a wall to the camera."""
    if "colour" not in table:
        if "height_m" in table:
            raise _BadWorldError(f"{where}height_m: only a coloured box has a height; add colour")
        return None
    colour = table["colour"]
    if not (isinstance(colour, list) and len(colour) == 3 and all(isinstance(c, int) for c in colour)):
        raise _BadWorldError(f"{where}colour = {colour!r}: give red, green and blue, each 0 to 255")
    red, green, blue = (min(max(value, 0), 255) for value in colour)
    height_m = _positive({"height_m": BOX_HEIGHT_M, **table}, "height_m", where)
    return Paint(colour=(red, green, blue), height_m=height_m)


def _surface(where: str, table: dict[str, Any]) -> int:
    name = table.get("surface", "matt")
    if name not in SURFACES:
        raise _BadWorldError(f"{where}surface = {name!r}: choose from {', '.join(SURFACES)}")
    return SURFACES[name]


def _table(where: str, table: dict[str, Any]) -> Furniture:
    x_m, y_m, length_m, width_m, yaw_deg = _box(where, table)
    filled = {"leg_radius_m": TABLE_LEG_RADIUS_M, "clearance_m": TABLE_CLEARANCE_M, **table}
    return Furniture(
        x_m=x_m,
        y_m=y_m,
        length_m=length_m,
        width_m=width_m,
        yaw_deg=yaw_deg,
        leg_radius_m=_positive(filled, "leg_radius_m", where),
        clearance_m=_positive(filled, "clearance_m", where),
    )


def _tag(where: str, table: dict[str, Any]) -> TagShape:
    number = table.get("id", 0)
    if not isinstance(number, int) or not 0 <= number < TAGS_IN_FAMILY:
        raise _BadWorldError(f"{where}id = {number!r}: give a whole number, 0 to {TAGS_IN_FAMILY - 1}")
    return TagShape(
        number=number,
        x_m=_number(table, "x_m", where),
        y_m=_number(table, "y_m", where),
        z_m=_positive({"z_m": TAG_HEIGHT_M, **table}, "z_m", where),
        yaw_deg=_number({"yaw_deg": 0.0, **table}, "yaw_deg", where),
        size_m=_positive({"size_m": TAG_SIZE_M, **table}, "size_m", where),
    )


def _sills(where: str, table: dict[str, Any]) -> Iterator[tuple[float, ...]]:
    height_m = _positive({"height_m": SILL_HEIGHT_M, **table}, "height_m", where)
    for (x0, y0), (x1, y1) in itertools.pairwise(_points(where, table, "points_m")):
        yield float(x0), float(y0), float(x1), float(y1), height_m


def _ramp(where: str, table: dict[str, Any]) -> tuple[float, ...]:
    box, rise_m = _box(where, table), _positive(table, "rise_m", where)
    most_m = STEEPEST_RAMP * box[2]
    if rise_m > most_m:
        raise _BadWorldError(
            f"{where}rise_m = {rise_m}: must be at most {STEEPEST_RAMP:g} of length_m, here {most_m:g} m"
        )
    return (*box, rise_m)


def _timed(where: str, table: dict[str, Any], obstacle: TimedObstacle) -> TimedObstacle:
    """Return the obstacle with its start and end times."""
    filled = {"from_s": 0.0, **table}
    from_s = _number(filled, "from_s", where)
    until_s = _number(table, "until_s", where) if "until_s" in table else math.inf
    if from_s >= until_s:
        raise _BadWorldError(f"{where}until_s = {until_s}: must be after from_s")
    return replace(obstacle, from_s=from_s, until_s=until_s)


def _person(where: str, table: dict[str, Any]) -> Pedestrian:
    filled = {"speed_m_s": PERSON_SPEED_M_S, "radius_m": PERSON_RADIUS_M, "from_s": 0.0, **table}
    leg_radius_m = _positive(table, "leg_radius_m", where) if "leg_radius_m" in table else 0.0
    points = _points(where, table, "waypoints_m")
    if any(a == b for a, b in itertools.pairwise(points)):
        raise _BadWorldError(f"{where}waypoints_m: two consecutive waypoints are equal; remove one")
    return Pedestrian(
        waypoints_m=np.array(points, np.float64),
        speed_m_s=_positive(filled, "speed_m_s", where),
        radius_m=_positive(filled, "radius_m", where),
        leg_radius_m=leg_radius_m,
        from_s=_number(filled, "from_s", where),
        returns=_yes_or_no(table, "returns", where, default=True),
    )


def _tables(data: dict[str, Any], kind: str) -> Iterator[tuple[str, dict[str, Any]]]:
    tables = data.get(kind, [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise _BadWorldError(f"{kind}: write each entry as [[{kind}]]")
    for index, table in enumerate(tables):
        where = f"{kind}[{index}]."
        _refuse_unknown(table, TABLE_KEYS[kind], where)
        if not isinstance(table.get("name", ""), str):
            raise _BadWorldError(f"{where}name = {table['name']!r}: must be a string")
        yield where, table


def _wall_segments(where: str, wall: dict[str, Any]) -> Iterator[tuple[float, float, float, float]]:
    points = _points(where, wall, "points_m")
    closed = _yes_or_no(wall, "closed", where, default=False)
    following = [*points[1:], points[0]] if closed else points[1:]
    for (x0, y0), (x1, y1) in zip(points, following, strict=False):
        yield float(x0), float(y0), float(x1), float(y1)


def _points(where: str, table: dict[str, Any], key: str) -> list[list[float]]:
    points = table.get(key)
    if not isinstance(points, list) or len(points) < 2:
        raise _BadWorldError(f"{where}{key}: give two or more points [x, y]")
    if not all(isinstance(point, list) and len(point) == 2 and all(map(_finite, point)) for point in points):
        raise _BadWorldError(f"{where}{key}: every point must be two finite numbers [x, y]")
    return points


def _number(table: dict[str, Any], key: str, where: str) -> float:
    if key not in table:
        raise _BadWorldError(f"{where}{key}: missing; give a number")
    if not _finite(table[key]):
        raise _BadWorldError(f"{where}{key} = {table[key]!r}: must be a finite number")
    return float(table[key])


def _positive(table: dict[str, Any], key: str, where: str) -> float:
    value = _number(table, key, where)
    if value <= 0.0:
        raise _BadWorldError(f"{where}{key} = {value}: must be above 0")
    return value


def _yes_or_no(table: dict[str, Any], key: str, where: str, *, default: bool) -> bool:
    value = table.get(key, default)
    if not isinstance(value, bool):
        raise _BadWorldError(f"{where}{key} = {value!r}: must be true or false")
    return value


def _finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _refuse_unknown(table: dict[str, Any], known: frozenset[str], where: str) -> None:
    for key in table:
        if key not in known:
            raise _BadWorldError(f"unknown key {where}{key}; choose from {', '.join(sorted(known))}")
