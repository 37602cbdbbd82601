"""The calibration course: ovals and turns in place in both directions, to excite all odometry errors."""

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le

from thumper.common.geometry import Twist2

FLOOR = "2.8 m x 2.8 m around the robot"


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseOptions:
    """Options of the course. A lap is an oval and a turn in place to the left, then both to the right."""

    speed_m_s: Annotated[float, Gt(0), Le(0.5)] = 0.3
    straight_m: Annotated[float, Gt(0), Le(3)] = 0.6
    radius_m: Annotated[float, Gt(0.2), Le(2)] = 0.4
    spot_rad_s: Annotated[float, Gt(0), Le(2)] = 0.8
    laps: Annotated[int, Ge(1), Le(20)] = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseLeg:
    """A constant twist and its duration."""

    twist: Twist2
    duration_s: float


def course(options: CourseOptions) -> list[CourseLeg]:
    """Return the legs of all laps; without errors, each lap ends where it started."""
    v, r = options.speed_m_s, options.radius_m
    straight = CourseLeg(twist=Twist2(v_m_s=v), duration_s=options.straight_m / v)
    legs: list[CourseLeg] = []
    for side in (1.0, -1.0):
        arc = CourseLeg(twist=Twist2(v_m_s=v, w_rad_s=side * v / r), duration_s=math.pi * r / v)
        turn = CourseLeg(
            twist=Twist2(w_rad_s=side * options.spot_rad_s), duration_s=math.tau / options.spot_rad_s
        )
        legs += [straight, arc, straight, arc, turn]
    return legs * options.laps
