"""Where to drive so that every error of odometry shows: ovals and turns on the spot, both ways round."""

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le

from thumper.common.geometry import Twist2

FLOOR = "2.8 m x 2.8 m round the robot"


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseOptions:
    """The course, as if by hand: a lap is an oval and a turn on the spot to the left, then to the right."""

    speed_m_s: Annotated[float, Gt(0), Le(0.5)] = 0.3
    straight_m: Annotated[float, Gt(0), Le(3)] = 0.6
    radius_m: Annotated[float, Gt(0.2), Le(2)] = 0.4
    spot_rad_s: Annotated[float, Gt(0), Le(2)] = 0.8
    laps: Annotated[int, Ge(1), Le(20)] = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """A twist and how long it holds."""

    twist: Twist2
    duration_s: float


def course(options: CourseOptions) -> list[Leg]:
    """The legs of all laps; each lap ends, but for the robot's errors, where it began."""
    v, r = options.speed_m_s, options.radius_m
    straight = Leg(twist=Twist2(v_m_s=v), duration_s=options.straight_m / v)
    legs: list[Leg] = []
    for way in (1.0, -1.0):
        arc = Leg(twist=Twist2(v_m_s=v, w_rad_s=way * v / r), duration_s=math.pi * r / v)
        spot = Leg(twist=Twist2(w_rad_s=way * options.spot_rad_s), duration_s=math.tau / options.spot_rad_s)
        legs += [straight, arc, straight, arc, spot]
    return legs * options.laps
