"""A gyroscope beside the wheels: the interface, and its options."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuSample:
    """One reading of a gyroscope that is mounted level; which chip it is, is its driver's business."""

    time_s: float  # on the host's clock, as telemetry's
    yaw_rate_rad_s: float  # counter-clockwise positive, the bias still in it


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuOptions:
    """The robot's `[imu]`; the defaults suit a cheap MEMS gyroscope."""

    enabled: bool = False
    noise_rad_s: Annotated[float, Gt(0)] = 0.005  # std of the mean rate over 1 s
    bias_rad_s: Annotated[float, Gt(0)] = 0.05  # std of the bias when switched on
    bias_walk_rad_s: Annotated[float, Gt(0)] = 0.0005  # std of the bias's change in 1 s
    slip_sigmas: Annotated[float, Gt(0.75)] = 3.0  # a step further off is not fused, and counts as this much
