"""The `[mapping.filter]` table."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class RbpfOptions:
    """Options of the particle filter. Those of `GridMapperOptions` apply, too."""

    particles: Annotated[int, Gt(0)] = 30  # number of hypotheses, each with its own map
    seed: Annotated[int, Ge(0)] = 1  # the same log and seed give the same map
    matched_beams: Annotated[int, Gt(0)] = 180  # hits are thinned to about this many for the match
    resample_below: Annotated[float, Interval(ge=0, le=1)] = 0.5  # share of effective particles
