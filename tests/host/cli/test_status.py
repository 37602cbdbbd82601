"""The lines of `thumper status`."""

import pytest

from thumper.cli.status import mode_text


@pytest.mark.parametrize(
    ("mode", "lost", "text"),
    [
        ("mapping", "", "mapping"),
        ("mapping", "the robot was moved", "mapping; the robot was moved"),
        ("localising", "", "localising, pose found"),
        ("localising", "places look alike", "localising, searching for the pose; places look alike"),
    ],
)
def test_it_shows_whether_the_pose_is_found(mode: str, lost: str, text: str) -> None:
    assert mode_text({"mode": mode, "lost": lost, "map_doubt": ""}) == text
