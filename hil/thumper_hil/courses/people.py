"""Courses through a hall in which people walk at 1 m/s, as two legs each. They never give way.

The bench judges whose a contact is (`bench/leg_contacts.py`).
"""

from collections.abc import Callable

import numpy as np

from thumper.common.geometry import Pose2
from thumper.navigation.goal import Goal
from thumper_hil.courses.course import Course

LEG_RADIUS_M, SPEED_M_S = 0.06, 1.0
HALL = "[[wall]]\nclosed = true\npoints_m = [[-1.5, -2.0], [5.5, -2.0], [5.5, 2.0], [-1.5, 2.0]]\n"
START, GOAL = Pose2(), Goal(x_m=4.5, y_m=0.0)
LIMIT_S = 90.0


def person(
    a_m: tuple[float, float], b_m: tuple[float, float], *, from_s: float, returns: bool = False
) -> str:
    """Return the table of a person who waits at `a_m`, walks to `b_m` and, with `returns`, back again."""
    return (
        f"[[person]]\nwaypoints_m = [{list(a_m)}, {list(b_m)}]\nspeed_m_s = {SPEED_M_S}\n"
        f"leg_radius_m = {LEG_RADIUS_M}\nfrom_s = {from_s}\nreturns = {str(returns).lower()}\n"
    )


def course_among(people: list[str]) -> Course:
    """Return the course through the hall with these people in it."""
    return Course(world_toml=HALL + "".join(people), start=START, goal=GOAL, limit_s=LIMIT_S)


def pacing(rng: np.random.Generator, *, returns: bool = True) -> list[str]:
    """Return one to three people who walk back and forth across the hall, straight or diagonally."""
    people = []
    for _ in range(int(rng.integers(1, 4))):
        x_m, side_m = float(rng.uniform(1.0, 3.8)), float(rng.choice((-1.7, 1.7)))
        there_m = (float(np.clip(x_m + rng.uniform(-1.0, 1.0), 0.9, 4.0)), -side_m)
        people.append(person((x_m, side_m), there_m, from_s=float(rng.uniform(0.0, 6.0)), returns=returns))
    return people


def crossing(rng: np.random.Generator) -> list[str]:
    """Return the same people, each of whom crosses once."""
    return pacing(rng, returns=False)


def oncoming(rng: np.random.Generator) -> list[str]:
    """Return a person who walks along the robot's path toward it and past it."""
    y_m = float(rng.uniform(-0.6, 0.6))
    return [person((5.2, y_m), (-1.0, y_m), from_s=float(rng.uniform(0.0, 5.0)))]


def blocking(rng: np.random.Generator) -> list[str]:
    """Return a person who stands on the robot's path and leaves; in half of the scenes another crosses."""
    x_m, side_m = float(rng.uniform(1.2, 3.5)), float(rng.choice((-1.6, 1.6)))
    y_m, leaves_s = float(rng.uniform(-0.2, 0.2)), float(rng.uniform(4.0, 15.0))
    people = [person((x_m, y_m), (x_m, side_m), from_s=leaves_s)]
    return people + crossing(rng)[:1] if rng.random() < 0.5 else people


KINDS: dict[str, Callable[[np.random.Generator], list[str]]] = {
    "crossing": crossing,
    "pacing": pacing,
    "oncoming": oncoming,
    "blocking": blocking,
}
