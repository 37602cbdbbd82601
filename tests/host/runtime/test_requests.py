"""A goal in a request is checked field by field."""

import math
import re
from typing import Any

import pytest

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.gps.earth_reference import MapDatum
from thumper.maps.annotations import Annotations, SavedPlace
from thumper.navigation.goal import Goal
from thumper.runtime.drive.waypoint_requests import parse_waypoints
from thumper.runtime.drive.waypoints import Waypoint, Waypoints
from thumper.runtime.requests import LogMessage, TeleopSource, parse_goal

PLACE = {"x_m": 1.0, "y_m": -2.0}


def test_complete_and_short_goals() -> None:
    assert parse_goal(PLACE) == Goal(x_m=1.0, y_m=-2.0, theta_rad=None, tolerance_m=0.1)
    full = {**PLACE, "yaw_rad": 0.5, "tolerance_m": 0.3}
    assert parse_goal(full) == Goal(x_m=1.0, y_m=-2.0, theta_rad=0.5, tolerance_m=0.3)
    assert parse_goal({"x_m": 3, "y_m": 0}).x_m == 3.0


@pytest.mark.parametrize(
    "wrong",
    [
        {"x_m": 1.0},
        {"y_m": 1.0},
        {**PLACE, "x_m": True},
        {**PLACE, "x_m": "1"},
        {**PLACE, "y_m": math.nan},
        {**PLACE, "yaw_rad": math.inf},
        {**PLACE, "yaw_rad": None},
        {**PLACE, "z_m": 0.0},
    ],
)
def test_anything_but_finite_numbers_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ThumperError, match="a goal has x_m, y_m"):
        parse_goal(wrong)


@pytest.mark.parametrize(("tolerance_m", "good"), [(0.019, False), (0.02, True), (1.0, True), (1.01, False)])
def test_tolerance_has_limits(tolerance_m: float, *, good: bool) -> None:
    content = {**PLACE, "tolerance_m": tolerance_m}
    if good:
        assert parse_goal(content).tolerance_m == tolerance_m
        return
    with pytest.raises(ThumperError, match=r"0\.02\.\.\.1 m"):
        parse_goal(content)


def test_far_goal_is_refused() -> None:
    with pytest.raises(ThumperError, match="farther"):
        parse_goal({"x_m": 1e4, "y_m": 0.0})


def test_a_place_on_earth_is_a_goal_in_a_map_with_a_datum() -> None:
    datum = MapDatum(48.0, 11.0, math.pi / 2)  # x points north
    there = {"latitude_deg": 48.0001, "longitude_deg": 11.0, "tolerance_m": 0.3}
    goal = parse_goal(there, datum=datum)
    assert (goal.x_m, goal.y_m) == pytest.approx((11.12, 0.0), abs=0.01)  # 111.19 km per degree at 48 degrees
    assert goal.tolerance_m == 0.3
    assert parse_waypoints({"goals": [there]}, SAVED, datum) == Waypoints.at(goal)
    with pytest.raises(ThumperError, match="the map has no place on Earth: it needs a datum"):
        parse_goal(there)


@pytest.mark.parametrize(
    ("latitude_deg", "longitude_deg", "why"),
    [
        (48.1, 11.0, "48.100000 11.000000 is 11.1 km from the map's origin; the farthest goal is 1 km away"),
        (-48.0, -169.0, "is 20015.1 km from"),  # the other side of the Earth, below the plane's origin
        (11.0, 48.0, "did you exchange latitude and longitude?"),
        (95.0, 11.0, "95 11 is not a place on Earth: latitude is -90...90 degrees, longitude -180...180"),
    ],
)
def test_a_place_too_far_is_refused_with_its_distance(
    latitude_deg: float, longitude_deg: float, why: str
) -> None:
    there = {"latitude_deg": latitude_deg, "longitude_deg": longitude_deg}
    with pytest.raises(ThumperError, match=re.escape(why)) as refused:
        parse_goal(there, datum=MapDatum(48.0, 11.0, 0.0))
    assert refused.value.exit_code == EXIT_USAGE


def test_a_far_place_is_not_called_exchanged() -> None:
    with pytest.raises(ThumperError, match=r"1 km away$"):
        parse_goal({"latitude_deg": 48.1, "longitude_deg": 11.0}, datum=MapDatum(48.0, 11.0, 0.0))


@pytest.mark.parametrize("name", ["latitude_deg", "longitude_deg"])
def test_a_place_on_earth_needs_both_coordinates(name: str) -> None:
    with pytest.raises(ThumperError, match="both numbers"):
        parse_goal({name: 48.0}, datum=MapDatum(48.0, 11.0, 0.0))


@pytest.mark.parametrize(
    "wrong", [{"latitude_deg": 91.0}, {"longitude_deg": "11"}, {"longitude_deg": math.nan}, {"x_m": 1.0}]
)
def test_a_wrong_place_on_earth_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ThumperError, match=r"a goal on Earth has latitude_deg|not a place on Earth"):
        parse_goal({"latitude_deg": 48.0, "longitude_deg": 11.0} | wrong, datum=MapDatum(48.0, 11.0, 0.0))


SOFA, DOOR = SavedPlace(name="sofa", x_m=1.0, y_m=2.0, yaw_rad=0.5), SavedPlace(name="door", x_m=3.0, y_m=0.0)
SAVED = Annotations(places=(SOFA, DOOR))


def test_a_place_is_a_goal() -> None:
    assert parse_goal({"place": "Sofa"}, SAVED) == Goal(x_m=1.0, y_m=2.0, theta_rad=0.5)
    assert parse_goal({"place": "door", "tolerance_m": 0.3}, SAVED) == Goal(x_m=3.0, y_m=0.0, tolerance_m=0.3)
    with pytest.raises(ThumperError, match="no place 'attic' on this map; choose from: sofa, door"):
        parse_goal({"place": "attic"}, SAVED)
    with pytest.raises(ThumperError, match="has place and optionally tolerance_m"):
        parse_goal({"place": "sofa", "x_m": 1.0}, SAVED)


def test_goals_have_rounds() -> None:
    goals: list[dict[str, Any]] = [{"place": "sofa"}, PLACE]
    points = (
        Waypoint(goal=parse_goal(goals[0], SAVED), place="sofa"),
        Waypoint(goal=parse_goal(PLACE)),
    )
    assert parse_waypoints({"goals": goals}, SAVED) == Waypoints(points=points)
    assert parse_waypoints({"goals": goals, "rounds": 1000}, SAVED).rounds == 1000
    for wrong in (0, 1001, 1.5, True, "2"):
        with pytest.raises(ThumperError, match="choose 1 to 1000 rounds over 2 goals"):
            parse_waypoints({"goals": goals, "rounds": wrong}, SAVED)


@pytest.mark.parametrize(
    "wrong", [{}, {"goals": []}, {"goals": {}}, {"goals": [PLACE] * 201}, {"goals": [PLACE], "laps": 2}]
)
def test_goals_are_a_list_of_limited_length(wrong: dict[str, Any]) -> None:
    with pytest.raises(ThumperError, match="a list of 1 to 200"):
        parse_waypoints(wrong, SAVED)


def test_each_of_the_goals_is_an_object() -> None:
    assert len(parse_waypoints({"goals": [PLACE] * 200}, SAVED).points) == 200
    with pytest.raises(ThumperError, match="each goal is an object"):
        parse_waypoints({"goals": [PLACE, "sofa"]}, SAVED)


def test_goals_have_a_wait() -> None:
    goals: list[dict[str, Any]] = [{"place": "sofa", "wait_s": 5}, PLACE]
    assert [point.wait_s for point in parse_waypoints({"goals": goals}, SAVED).points] == [5.0, 0.0]
    for wrong in (-1.0, 3600.1, True, "2", None, float("nan")):
        with pytest.raises(ThumperError, match=r"choose a wait_s of 0\.\.\.3600 s"):
            parse_waypoints({"goals": [PLACE | {"wait_s": wrong}]}, SAVED)


def test_a_goal_asks_for_a_recording_while_the_robot_waits() -> None:
    goals: list[dict[str, Any]] = [{"place": "sofa", "wait_s": 5, "record": True}, PLACE]
    assert [point.record for point in parse_waypoints({"goals": goals}, SAVED).points] == [True, False]
    for wrong in ({"record": True}, {"record": 1, "wait_s": 5}, {"record": "yes", "wait_s": 5}):
        with pytest.raises(ThumperError, match="record is true or false; the robot records while it waits"):
            parse_waypoints({"goals": [PLACE | wrong]}, SAVED)


def test_gamepad_outranks_the_other_source() -> None:
    assert TeleopSource.GAMEPAD > TeleopSource.TELEOP


def test_log_message_is_a_warning_unless_it_says_otherwise() -> None:
    assert not LogMessage(text="").good
