"""Keep-out and slow zones and named places that people draw on a map, and its AprilTags. Saved as GeoJSON.

The file is a FeatureCollection of RFC 7946 whose coordinates are metres in `map`, as in Nav2's route graphs.
A zone is a Polygon without holes, a place or tag is a Point.
"""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import read_text, write_text
from thumper.common.geometry import FloatArray, Pose2
from thumper.common.texts import choice_hint

SUFFIX = ".geojson"
MAX_ZONES, MAX_PLACES, MAX_VERTICES = 50, 200, 100
MAX_SIDE_M = 50.0  # of a zone, whose cells are kept in memory
FARTHEST_M = 1000.0  # from the origin of the map
MAX_FILE_MB = 2.0
TAGS = 587  # in the family 36h11
SLOWEST_PERCENT, FASTEST_PERCENT, USUAL_PERCENT = 10, 90, 50
NAME = re.compile(r"[^\W_](?:[\w .'-]{0,38}[\w.'-])?")
NAME_HELP = "1 to 40 letters, digits, spaces and . ' - _, beginning with a letter or digit"


class ZoneKind(Enum):
    """What a zone does."""

    KEEPOUT = "keepout"  # its cells are obstacles for planner and controller
    SLOW = "slow"  # it limits the speed


@dataclass(frozen=True, slots=True, kw_only=True)
class Zone:
    """A polygon in `map`."""

    name: str
    kind: ZoneKind
    vertices_m: tuple[tuple[float, float], ...]
    speed_percent: int = USUAL_PERCENT  # of the top speed, in a slow zone

    def polygon_m(self) -> FloatArray:
        """Return the vertices, shape (k, 2) [m]."""
        return np.array(self.vertices_m, dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedPlace:
    """A named goal in `map`."""

    name: str
    x_m: float
    y_m: float
    yaw_rad: float | None = None  # None: any heading


@dataclass(frozen=True, slots=True, kw_only=True)
class SavedTag:
    """An AprilTag on a wall, of the family 36h11."""

    number: int
    x_m: float
    y_m: float
    yaw_rad: float  # where it faces

    @property
    def name(self) -> str:
        """Its name on the map."""
        return f"tag {self.number}"


Annotation = Zone | SavedPlace | SavedTag


@dataclass(frozen=True, slots=True, kw_only=True)
class Annotations:
    """What belongs to one map. Each name exists once; upper and lower case are the same name."""

    zones: tuple[Zone, ...] = field(default=())
    places: tuple[SavedPlace, ...] = field(default=())
    tags: tuple[SavedTag, ...] = field(default=())

    def __bool__(self) -> bool:
        return bool(self.zones or self.places or self.tags)

    def __iter__(self) -> Iterator[Annotation]:
        return iter((*self.zones, *self.places, *self.tags))

    def with_item(self, item: Annotation) -> "Annotations":
        """Return these and `item`, which replaces the one of its name; raises ThumperError if too many."""
        if not item.name:
            assert isinstance(item, Zone)  # only zones may have no name
            item = replace(item, name=self._free_name(item.kind.value))
        others = self.without(item.name) if self.find(item.name) else self
        if isinstance(item, Zone):
            others = replace(others, zones=(*others.zones, item))
        elif isinstance(item, SavedTag):
            others = replace(others, tags=(*others.tags, item))
        else:
            others = replace(others, places=(*others.places, item))
        if len(others.zones) > MAX_ZONES or len(others.places) > MAX_PLACES:
            raise ThumperError(
                f"a map has at most {MAX_ZONES} zones and {MAX_PLACES} places: remove one first"
            )
        return others

    def without(self, name: str) -> "Annotations":
        """Return these without the zone or place of that name; raises ThumperError if there is none."""
        item = self.find(name)
        if item is None:
            raise ThumperError(f"no zone, place or tag {name!r} on this map; {self._names_text()}")
        return Annotations(
            zones=tuple(zone for zone in self.zones if zone is not item),
            places=tuple(place for place in self.places if place is not item),
            tags=tuple(tag for tag in self.tags if tag is not item),
        )

    def find(self, name: str) -> Annotation | None:
        """Return the zone, place or tag of that name; None if there is none."""
        wanted = name.strip().casefold()
        return next((item for item in self if item.name.casefold() == wanted), None)

    def place(self, name: str) -> SavedPlace:
        """Return the place of that name; raises ThumperError, which lists the places, if there is none."""
        item = self.find(name)
        if not isinstance(item, SavedPlace):
            names = [place.name for place in self.places]
            cure = choice_hint(name, names) if names else "save one on the dashboard first"
            raise ThumperError(f"no place {name!r} on this map; {cure}", exit_code=EXIT_USAGE)
        return item

    def rotated(self, angle_rad: float) -> "Annotations":
        """Return these after a counter-clockwise rotation of the map round its origin (0, 0)."""
        turn = Pose2(theta_rad=angle_rad)
        zones = tuple(
            replace(zone, vertices_m=tuple((float(x), float(y)) for x, y in turn.apply(zone.polygon_m())))
            for zone in self.zones
        )
        places = []
        for place in self.places:
            ((x_m, y_m),) = turn.apply(np.array(((place.x_m, place.y_m),)))
            yaw_rad = None if place.yaw_rad is None else math.remainder(place.yaw_rad + angle_rad, math.tau)
            places.append(replace(place, x_m=float(x_m), y_m=float(y_m), yaw_rad=yaw_rad))
        tags = []
        for tag in self.tags:
            at = turn @ Pose2(x_m=tag.x_m, y_m=tag.y_m, theta_rad=tag.yaw_rad)
            tags.append(replace(tag, x_m=at.x_m, y_m=at.y_m, yaw_rad=at.theta_rad))
        return Annotations(zones=zones, places=tuple(places), tags=tuple(tags))

    def to_geojson(self) -> dict[str, Any]:
        """Return the FeatureCollection."""
        return {"type": "FeatureCollection", "features": [_feature(item) for item in self]}

    def _free_name(self, kind: str) -> str:
        numbers = range(1, MAX_ZONES + MAX_PLACES + 2)
        return next(f"{kind} {number}" for number in numbers if self.find(f"{kind} {number}") is None)

    def _names_text(self) -> str:
        return f"there are: {', '.join(item.name for item in self)}" if self else "there is none"


def annotations_path(map_path: Path) -> Path:
    """Return the file beside a map's .yaml or .session."""
    return map_path.with_suffix(SUFFIX)


def save_annotations(annotations: Annotations, path: Path) -> list[str]:
    """Write the file and return its name; without any annotations remove it. Raises ThumperError."""
    if annotations:
        write_text(path, json.dumps(annotations.to_geojson(), indent=1) + "\n")
        return [path.name]
    path.unlink(missing_ok=True)
    return []


def load_annotations(path: Path) -> Annotations:
    """Read a file of `save_annotations`; none if it does not exist.

    Raises
    ------
    ThumperError
        The file cannot be read or is invalid; the message names the file and the feature.
    """
    if not path.exists():
        return Annotations()
    try:
        return annotations_of(json.loads(read_text(path, MAX_FILE_MB)))
    except OSError as error:
        raise ThumperError(
            f"{path}: cannot be read ({error.strerror}); check the file", exit_code=EXIT_USAGE
        ) from error
    except (ValueError, RecursionError) as error:
        raise ThumperError(f"{path}: not valid JSON ({error}); correct it", exit_code=EXIT_USAGE) from error
    except ThumperError as error:
        raise ThumperError(f"{path}: {error}", exit_code=EXIT_USAGE) from error


def annotations_of(collection: object) -> Annotations:
    """Return the annotations of a FeatureCollection; raises ThumperError for a wrong one."""
    features = collection.get("features") if isinstance(collection, Mapping) else None
    if not isinstance(features, list):
        raise ThumperError("not a GeoJSON FeatureCollection")
    found = Annotations()
    for number, feature in enumerate(features, 1):
        try:
            item = parse_feature(feature)
        except ThumperError as error:
            raise ThumperError(f"feature {number}: {error}") from None
        if item.name and found.find(item.name):
            raise ThumperError(f"feature {number}: the name {item.name!r} exists twice")
        found = found.with_item(item)
    return found


def parse_feature(feature: object) -> Annotation:
    """Return the zone, place or tag of one GeoJSON feature; a zone may have no name yet.

    Raises
    ------
    ThumperError
        A member is missing or wrong.
    """
    feature = feature if isinstance(feature, Mapping) else {}
    properties, geometry = feature.get("properties"), feature.get("geometry")
    if not (isinstance(properties, Mapping) and isinstance(geometry, Mapping)):
        raise ThumperError("not a GeoJSON feature with properties and geometry")
    kind, shape, coordinates = properties.get("kind"), geometry.get("type"), geometry.get("coordinates")
    if kind == "place":
        if shape != "Point":
            raise ThumperError("a place is a Point")
        x_m, y_m = _position(coordinates)
        yaw_rad = properties.get("yaw_rad")
        if yaw_rad is not None and not _is_number(yaw_rad):
            raise ThumperError("yaw_rad is not a finite number")
        return SavedPlace(
            name=_name(properties),
            x_m=x_m,
            y_m=y_m,
            yaw_rad=None if yaw_rad is None else math.remainder(yaw_rad, math.tau),
        )
    if kind == "tag":
        return _parse_tag(properties, shape, coordinates)
    if kind not in ("keepout", "slow"):
        raise ThumperError(f"unknown kind {kind!r}; choose from: keepout, slow, place, tag")
    if shape != "Polygon":
        raise ThumperError("a zone is a Polygon")
    percent = properties.get("speed_percent", USUAL_PERCENT)
    if not (isinstance(percent, int) and SLOWEST_PERCENT <= percent <= FASTEST_PERCENT):
        raise ThumperError(f"speed_percent: choose an integer of {SLOWEST_PERCENT}...{FASTEST_PERCENT}")
    return Zone(
        name=_name(properties) if properties.get("name") else "",
        kind=ZoneKind(kind),
        vertices_m=_ring(coordinates),
        speed_percent=percent,
    )


def _parse_tag(properties: Mapping[str, Any], shape: object, coordinates: object) -> SavedTag:
    number, yaw_rad = properties.get("number"), properties.get("yaw_rad", math.nan)
    if shape != "Point" or not isinstance(number, int) or not 0 <= number < TAGS or not _is_number(yaw_rad):
        raise ThumperError(f"a tag is a Point with number, 0...{TAGS - 1}, and yaw_rad")
    x_m, y_m = _position(coordinates)
    return SavedTag(number=number, x_m=x_m, y_m=y_m, yaw_rad=math.remainder(float(yaw_rad), math.tau))


def _ring(coordinates: object) -> tuple[tuple[float, float], ...]:
    """Return the vertices of a polygon; its ring may or may not repeat the first one at the end."""
    if not (isinstance(coordinates, Sequence) and len(coordinates) == 1 and isinstance(coordinates[0], list)):
        raise ThumperError("a zone is one ring of positions, without holes")
    ring = coordinates[0]
    if not 3 <= len(ring) <= MAX_VERTICES + 1:
        raise ThumperError(f"a zone has 3 to {MAX_VERTICES} corners")
    vertices = [_position(position) for position in ring]
    if vertices[0] == vertices[-1]:
        vertices.pop()
    if len(vertices) < 3:
        raise ThumperError(f"a zone has 3 to {MAX_VERTICES} corners")
    for values in zip(*vertices, strict=True):
        if max(values) - min(values) > MAX_SIDE_M:
            raise ThumperError(f"a zone is at most {MAX_SIDE_M:g} m wide and long: draw several")
    return tuple(vertices)


def _position(position: object) -> tuple[float, float]:
    if not (isinstance(position, Sequence) and len(position) == 2 and all(map(_is_number, position))):
        raise ThumperError("a position is [x, y] in metres")
    x_m, y_m = map(float, position)
    if math.hypot(x_m, y_m) > FARTHEST_M:
        raise ThumperError(f"({x_m:g}, {y_m:g}) is farther than {FARTHEST_M:g} m from the map's origin")
    return x_m, y_m


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _name(properties: Mapping[str, Any]) -> str:
    name = properties.get("name")
    if not (isinstance(name, str) and NAME.fullmatch(name)):
        raise ThumperError(f"name: use {NAME_HELP}")
    try:
        float(name)
    except ValueError:
        return name
    raise ThumperError(f"name: {name!r} is a number; add a letter")


def _feature(item: Annotation) -> dict[str, Any]:
    properties: dict[str, Any] = {"name": item.name}
    if not isinstance(item, Zone):
        properties["kind"] = "place" if isinstance(item, SavedPlace) else "tag"
        if item.yaw_rad is not None:
            properties["yaw_rad"] = item.yaw_rad
        if isinstance(item, SavedTag):
            properties["number"] = item.number
        geometry: dict[str, Any] = {"type": "Point", "coordinates": [item.x_m, item.y_m]}
    else:
        properties["kind"] = item.kind.value
        if item.kind is ZoneKind.SLOW:
            properties["speed_percent"] = item.speed_percent
        ring = [list(vertex) for vertex in (*item.vertices_m, item.vertices_m[0])]
        geometry = {"type": "Polygon", "coordinates": [ring]}
    return {"type": "Feature", "properties": properties, "geometry": geometry}
