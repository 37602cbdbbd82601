"""People at 1 m/s, on two legs, who cross, block or come along the path: the robot drives into nobody."""

import pytest

from thumper_hil.courses.course import drive_course
from thumper_hil.courses.people import course_among, person

NEVER_S = 1e6
CROSSING = {from_s: [person((2.0, -1.7), (2.0, 1.7), from_s=from_s)] for from_s in (1.0, 2.0, 3.0, 4.0)}
TWO = [person((1.6, -1.7), (1.6, 1.7), from_s=1.5), person((3.0, 1.7), (3.0, -1.7), from_s=2.5)]
BLOCKING = [person((2.0, 0.0), (2.0, 1.6), from_s=12.0)]
STAYING = [person((2.0, 0.0), (2.0, 1.6), from_s=NEVER_S)]


def along_the_path(from_s: float) -> str:
    return person((5.2, 0.2), (-1.0, 0.2), from_s=from_s)


@pytest.mark.parametrize(
    "people",
    [
        pytest.param(CROSSING[1.0], id="cross 1 s", marks=pytest.mark.slow),
        pytest.param(CROSSING[2.0], id="cross 2 s"),
        pytest.param(CROSSING[3.0], id="cross 3 s", marks=pytest.mark.slow),
        pytest.param(CROSSING[4.0], id="cross 4 s", marks=pytest.mark.slow),
        pytest.param(TWO, id="two", marks=pytest.mark.slow),
        pytest.param([along_the_path(1.0)], id="along the path", marks=pytest.mark.slow),
        pytest.param(BLOCKING, id="blocks, then goes", marks=pytest.mark.slow),
        pytest.param(STAYING, id="stays", marks=pytest.mark.slow),
    ],
)
def test_drives_into_nobody(people: list[str]) -> None:
    run = drive_course(course_among(people), preset="nominal", seed=0)
    assert run.contacts == 0
    assert run.reached or run.touches_by_people, run.reason


@pytest.mark.slow
def test_steps_aside_for_somebody_who_comes_along_the_path() -> None:
    """They do not look: one who changes nothing may brush a robot that stands aside."""
    touches = 0
    for from_s in (0.5, 1.0, 1.5, 2.0, 2.5, 3.0):
        run = drive_course(course_among([along_the_path(from_s)]), preset="nominal", seed=0)
        assert run.reached, run.reason
        assert run.contacts == 0
        touches += run.touches_by_people
    assert touches <= 1
