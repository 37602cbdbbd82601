"""Samples of a gyroscope, and the options of its fusion."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuSample:
    """One reading of a level gyroscope, from any driver."""

    time_s: float  # on the host's clock, like the telemetry
    yaw_rate_rad_s: float  # counter-clockwise positive, including the bias


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuOptions:
    """Options of the gyroscope; the defaults suit a cheap MEMS chip."""

    enabled: bool = False  # fuse the gyroscope's rate with the wheels' odometry
    noise_rad_s: Annotated[float, Gt(0)] = 0.005  # std of the mean rate over 1 s
    bias_rad_s: Annotated[float, Gt(0)] = 0.05  # std of the bias at power-on
    bias_walk_rad_s: Annotated[float, Gt(0)] = 0.0005  # std of the change of the bias in 1 s
    slip_sigmas: Annotated[float, Gt(0.75)] = 3.0  # a larger disagreement is not fused, and counts as this
