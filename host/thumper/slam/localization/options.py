"""The `[localization]` table."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class AmclOptions:
    """Options of `Amcl`."""

    least_particles: Annotated[int, Gt(0)] = 100  # lower limit of KLD sampling
    most_particles: Annotated[int, Gt(0)] = 3000  # upper limit of KLD sampling
    beam_std_m: Annotated[float, Gt(0)] = 0.1  # width of the likelihood field
    usable_range_m: Annotated[float, Gt(0)] = 30.0  # beams count up to this range
    noise_per_m: Annotated[float, Ge(0)] = 0.1  # odometry error after 1 m: position [m] and heading [rad]
    noise_per_rad: Annotated[float, Ge(0)] = 0.15  # error of the heading after a turn of 1 rad
    update_distance_m: Annotated[float, Gt(0)] = 0.1  # weigh a scan after this distance
    update_angle_rad: Annotated[float, Gt(0)] = 0.1  # weigh a scan after this turn, too
    lost_below: Annotated[float, Interval(ge=0, le=1)] = 0.45  # share of beams explained; lost below it
    seed: Annotated[int, Ge(0)] = 1  # the same log and seed give the same poses
