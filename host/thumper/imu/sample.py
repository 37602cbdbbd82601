"""One reading of a gyroscope or inertial unit, as all drivers deliver it."""

import math
from dataclasses import dataclass, replace

from thumper.common.stamps import rounded_s


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuSample:
    """The turn rate about the vertical, and what else the device measures (NaN: it does not)."""

    time_s: float  # on the host's clock, like the telemetry
    yaw_rate_rad_s: float  # mean since the previous sample, counter-clockwise positive, with the bias
    yaw_rate_std_rad_s: float = 0.0  # without that of the bias; 0: unknown
    roll_rad: float = math.nan
    pitch_rad: float = math.nan
    yaw_rad: float = math.nan  # since the device's start: it drifts
    acceleration_m_s2: tuple[float, float, float] | None = None  # x, y, z with gravity

    def as_recorded(self) -> "ImuSample":
        """Return the sample as a recording stores it: whole nanoseconds."""
        return replace(self, time_s=rounded_s(self.time_s))
