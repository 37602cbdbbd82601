"""One position from a GPS receiver, as all drivers deliver it."""

import math
from dataclasses import dataclass, replace
from enum import IntEnum

from thumper.common.stamps import rounded_s

RTK_FIXED_STD_M = 0.1  # a better position by RTK has resolved ambiguities, a worse one is RTK float


class FixStatus(IntEnum):
    """The status of sensor_msgs/NavSatStatus, which has one status for both kinds of RTK."""

    NONE = -1
    GPS = 0
    SBAS = 1  # corrected by a satellite or a differential service
    RTK = 2  # corrected by a base station on the ground, to centimetres
    RTK_FLOAT = 3  # the same with unresolved ambiguities, to decimetres

    @property
    def text(self) -> str:
        """Name for people."""
        return {FixStatus.NONE: "no fix", FixStatus.RTK_FLOAT: "RTK float"}.get(self, f"{self.name} fix")


@dataclass(frozen=True, slots=True, kw_only=True)
class Fix:
    """Position of the antenna; NaN without a fix."""

    time_s: float  # on the host's clock, like the telemetry
    status: FixStatus = FixStatus.NONE
    latitude_deg: float = math.nan  # WGS 84
    longitude_deg: float = math.nan
    altitude_m: float = math.nan  # above the ellipsoid
    variances_m2: tuple[float, float, float] = (math.nan, math.nan, math.nan)  # east, north, up

    @property
    def std_m(self) -> float:
        """Standard deviation of the position along its worse horizontal axis [m]; NaN without a fix."""
        worse_m2 = max(self.variances_m2[:2])
        return math.sqrt(worse_m2) if worse_m2 >= 0.0 else math.nan

    @property
    def text(self) -> str:
        """Kind and accuracy for people."""
        accuracy = "" if self.status is FixStatus.NONE else f", {self.std_m:.2f} m"
        return self.status.text + accuracy

    def as_recorded(self) -> "Fix":
        """Return the fix at the time that a recording stores: whole nanoseconds."""
        return replace(self, time_s=rounded_s(self.time_s))
