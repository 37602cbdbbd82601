"""Routes for `thumper run --route`."""

from pathlib import Path

import pytest

from thumper.cli.route import load_route
from thumper.common.errors import ThumperError
from thumper.maps.annotations import Annotations, SavedPlace, annotations_path, save_annotations
from thumper.navigation.goal import Goal
from thumper.runtime.drive.waypoints import Waypoint, Waypoints

ROUTE = """
rounds = 2

[[goals]]
x_m = 1.0
y_m = 0.5
yaw_rad = 1.57
wait_s = 5.0
record = true
beep = true

[[goals]]
place = "door"
"""


def test_a_route_has_headings_waits_recordings_and_places_of_the_map(tmp_path: Path) -> None:
    route, saved_map = tmp_path / "route.toml", tmp_path / "map.yaml"
    route.write_text(ROUTE)
    door = SavedPlace(name="door", x_m=2.0, y_m=0.0, yaw_rad=None)
    save_annotations(Annotations(places=(door,)), annotations_path(saved_map))
    first = Waypoint(goal=Goal(x_m=1.0, y_m=0.5, theta_rad=1.57), wait_s=5.0, record=True, beep=True)
    points = (first, Waypoint(goal=Goal(x_m=2.0, y_m=0.0), place="door"))
    assert load_route(route, None, saved_map) == Waypoints(points=points, rounds=2)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (None, "cannot read the route"),
        ("[[goals]", ":1: not valid TOML"),
        ("rounds = 2", "pass goals, a list of 1 to 200"),
        ("[[goals]]\nx_m = 1.0", "a goal has x_m, y_m"),
        ('[[goals]]\nplace = "door"', "no place 'door'"),
        ("[[goals]]\nx_m = 1.0\ny_m = 0.5\nbeep = 2", "beep is true or false"),
    ],
)
def test_a_wrong_route_is_refused_with_its_name(tmp_path: Path, text: str | None, why: str) -> None:
    route = tmp_path / "route.toml"
    if text is not None:
        route.write_text(text)
    with pytest.raises(ThumperError, match=why) as error:
        load_route(route, None, None)
    assert str(error.value).startswith(str(route))
