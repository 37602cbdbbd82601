"""The robot's `[localization]`."""

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Ge, Gt, Interval

from thumper.slam.scan_matching.gauss_newton import MatchOptions


@dataclass(frozen=True, slots=True, kw_only=True)
class AmclOptions:
    """Options of `Amcl`."""

    least_particles: Annotated[int, Gt(0)] = 100
    most_particles: Annotated[int, Gt(0)] = 3000
    kld_error: Annotated[float, Gt(0)] = 0.05  # distance to the true distribution that is allowed ...
    kld_quantile: Annotated[float, Gt(0)] = 2.33  # ... with this certainty: 2.33 is 99 %
    kld_cell_m: Annotated[float, Gt(0)] = 0.25  # particles of one such cell ...
    kld_cell_rad: Annotated[float, Gt(0)] = 0.2  # ... and heading count as one hypothesis
    beams: Annotated[int, Gt(0)] = 60  # hits are thinned to about this many
    beam_std_m: Annotated[float, Gt(0)] = 0.1  # width of the likelihood field
    random_share: Annotated[float, Interval(gt=0, lt=1)] = (
        0.1  # share of beams that people and chairs reflect
    )
    beam_gain: Annotated[float, Gt(0)] = 0.15  # share of a beam's evidence: neighbouring beams repeat it
    usable_range_m: Annotated[float, Gt(0)] = 30.0
    noise_per_m: Annotated[float, Ge(0)] = 0.1  # std of the way and, in rad, of the heading after 1 m
    noise_per_rad: Annotated[float, Ge(0)] = 0.15  # std of the heading after 1 rad
    update_distance_m: Annotated[float, Gt(0)] = 0.1  # weigh a scan after this much way ...
    update_angle_rad: Annotated[float, Gt(0)] = 0.1  # ... or this much turn
    lost_below: Annotated[float, Interval(ge=0, le=1)] = (
        0.45  # share of beams explained; below it, it is lost
    )
    lost_after: Annotated[int, Gt(0)] = 3  # weighed scans in a row before the whole map is searched
    seed: Annotated[int, Ge(0)] = 1
    matching: MatchOptions = field(default_factory=MatchOptions)
