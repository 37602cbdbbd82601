"""Zones and places of a map: their file, and what it refuses."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from thumper.common.errors import ThumperError
from thumper.maps.annotations import (
    Annotations,
    SavedPlace,
    SavedTag,
    Zone,
    ZoneKind,
    annotations_path,
    load_annotations,
    parse_feature,
    save_annotations,
)

STAIRS = Zone(name="stairs", kind=ZoneKind.KEEPOUT, vertices_m=((0.0, 0.0), (2.0, 0.0), (1.0, 1.5)))
RAMP = Zone(
    name="ramp", kind=ZoneKind.SLOW, vertices_m=((3.0, 0.0), (4.0, 0.0), (4.0, 1.0)), speed_percent=30
)
KITCHEN = SavedPlace(name="Küche 2", x_m=1.25, y_m=-0.5, yaw_rad=1.5)
DOOR = SavedPlace(name="door", x_m=-1.0, y_m=0.0)
TAG = SavedTag(number=7, x_m=2.0, y_m=-1.0, yaw_rad=0.5)
ALL = Annotations(zones=(STAIRS, RAMP), places=(KITCHEN, DOOR), tags=(TAG,))


def feature(kind: str, shape: str, coordinates: object, **properties: object) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": {"kind": kind, **properties},
        "geometry": {"type": shape, "coordinates": coordinates},
    }


def test_a_saved_file_reads_back_alike(tmp_path: Path) -> None:
    path = annotations_path(tmp_path / "map.yaml")
    assert save_annotations(ALL, path) == ["map.geojson"]
    assert load_annotations(path) == ALL
    ring = json.loads(path.read_text())["features"][0]["geometry"]["coordinates"][0]
    assert ring[0] == ring[-1]  # as RFC 7946 wants it
    assert save_annotations(Annotations(), path) == []
    assert not path.exists()  # a map without zones must not get those of the map before it
    assert load_annotations(path) == Annotations()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "not valid JSON"),
        ("[]", "not a GeoJSON FeatureCollection"),
        (feature("stairs", "Polygon", [[[0, 0], [1, 0], [1, 1]]]), "unknown kind 'stairs'"),
        (feature("keepout", "Polygon", [[[0, 0], [1, 0], [0, 0]]]), "3 to 100 corners"),
        (feature("keepout", "Polygon", [[[0, 0], [60, 0], [1, 1]]]), "at most 50 m"),
        (feature("keepout", "Polygon", [[[0, 0], [1, "a"], [1, 1]]]), r"\[x, y\] in metres"),
        (feature("slow", "Polygon", [[[0, 0], [1, 0], [1, 1]]], speed_percent=0), "speed_percent"),
        (feature("place", "Point", [0, 2000], name="far"), "farther than 1000 m"),
        (feature("tag", "Point", [0, 0], number=587, yaw_rad=0.0), "a tag is a Point with number"),
        (feature("tag", "Point", [0, 0], number=0), "a tag is a Point with number"),
        (feature("place", "Point", [0, 0], name="3.5"), "is a number"),
        (feature("place", "Point", [0, 0], name="../x"), "name: use"),
        (feature("place", "Point", [0, 0]), "name: use"),
    ],
)
def test_an_invalid_file_is_refused_in_one_line(tmp_path: Path, content: Any, message: str) -> None:
    path = tmp_path / "map.geojson"
    collection = {"type": "FeatureCollection", "features": [content]}
    path.write_text(content if isinstance(content, str) else json.dumps(collection))
    with pytest.raises(ThumperError, match=message) as caught:
        load_annotations(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    assert caught.value.exit_code == 2


def test_a_name_belongs_to_one_item() -> None:
    moved = SavedPlace(name="Door", x_m=2.0, y_m=0.0)
    changed = ALL.with_item(moved)
    assert changed.place("DOOR") is moved
    assert [place.name for place in changed.places] == ["Küche 2", "Door"]
    unnamed = parse_feature(feature("keepout", "Polygon", [[[0, 0], [1, 0], [1, 1]]]))
    twice = ALL.with_item(unnamed).with_item(unnamed)
    assert [zone.name for zone in twice.zones] == ["stairs", "ramp", "keepout 1", "keepout 2"]
    assert ALL.without("Stairs").zones == (RAMP,)
    with pytest.raises(ThumperError, match="no place 'attic' on this map; choose from: Küche 2, door"):
        ALL.place("attic")
    with pytest.raises(ThumperError, match="no place 'stairs'"):
        ALL.place("stairs")  # a zone is no place to drive to


def test_a_rotation_of_the_map_takes_them_along() -> None:
    turned = ALL.rotated(math.pi / 2)
    assert turned.zones[0].vertices_m[2] == pytest.approx((-1.5, 1.0))
    kitchen = turned.place("Küche 2")
    assert (kitchen.x_m, kitchen.y_m, kitchen.yaw_rad) == pytest.approx((0.5, 1.25, 1.5 + math.pi / 2))
    assert turned.place("door").yaw_rad is None
