"""The lines of `thumper status`."""

import pytest

from thumper.cli.status import _json, earth_text, mode_text


@pytest.mark.parametrize(
    ("mode", "lost", "text"),
    [
        ("mapping", "", "mapping"),
        ("mapping", "the robot was moved", "mapping; the robot was moved"),
        ("localizing", "", "localizing, pose found"),
        ("localizing", "places look alike", "localizing, searching for the pose; places look alike"),
    ],
)
def test_it_shows_whether_the_pose_is_found(mode: str, lost: str, text: str) -> None:
    assert mode_text({"mode": mode, "lost": lost, "map_doubt": ""}) == text


@pytest.mark.parametrize(
    ("datum", "gps", "text"),
    [
        ("", "off", ""),
        ("at 48 11", "off", "at 48 11"),
        ("at 48 11", "ok", "at 48 11"),
        ("", "the GPS has no fix", "the GPS has no fix"),
        ("at 48 11", "the GPS has no fix", "at 48 11; the GPS has no fix"),
    ],
)
def test_it_shows_the_place_on_earth_of_a_robot_that_may_have_one(datum: str, gps: str, text: str) -> None:
    assert earth_text({"datum": datum, "gps": gps}) == text


def test_a_number_has_no_digits_that_no_sensor_resolves() -> None:
    content = {
        "twist": [4.999947122996673e-10, -4.9e-10, 0.30000000000000004],
        "latitude": 48.26243124,
        "n": 12,
    }
    assert _json(content) == '{"twist": [0.0, 0.0, 0.3], "latitude": 48.26243124, "n": 12}'
