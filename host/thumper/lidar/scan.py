"""One revolution of a 2-D lidar, as all drivers deliver it."""

from dataclasses import dataclass, replace

import numpy as np

from thumper.common.attribute_hints import HintedAttributes
from thumper.common.geometry import FloatArray
from thumper.common.stamps import rounded_s


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Scan(HintedAttributes):
    """Ranges in the laser frame; beam i points at angle_min + i * angle_increment.

    `ranges_m` has shape (n,), in the order of measurement. NaN is invalid, +inf means no return up to
    `range_max_m` (REP-117). A clockwise sensor has a negative `angle_increment_rad`. `time_s` is when beam 0
    was measured, on the host's clock.
    """

    time_s: float
    ranges_m: FloatArray
    angle_min_rad: float
    angle_increment_rad: float
    time_increment_s: float = 0.0
    range_min_m: float = 0.02
    range_max_m: float = 5.6

    def __repr__(self) -> str:
        hits_m = self.ranges_m[np.isfinite(self.ranges_m)]
        reach = f", {hits_m.min():.2f}...{hits_m.max():.2f} m" if hits_m.size else ""
        return f"<Scan: {hits_m.size} returns of {self.ranges_m.size} beams{reach}>"

    def angles_rad(self) -> FloatArray:
        """Return the direction of each beam in the laser frame, shape (n,)."""
        steps = np.arange(self.ranges_m.size, dtype=np.float64)
        return np.asarray(self.angle_min_rad + self.angle_increment_rad * steps, dtype=np.float64)

    def upside_down(self) -> "Scan":
        """Return the scan of the same lidar mounted the other way up: beams to its left are to its right."""
        return replace(self, angle_min_rad=-self.angle_min_rad, angle_increment_rad=-self.angle_increment_rad)

    def as_recorded(self) -> "Scan":
        """Return the scan as a recording stores it: single precision, whole nanoseconds."""
        return replace(
            self,
            time_s=rounded_s(self.time_s),
            ranges_m=self.ranges_m.astype(np.float32).astype(np.float64),
            angle_min_rad=_single(self.angle_min_rad),
            angle_increment_rad=_single(self.angle_increment_rad),
            time_increment_s=_single(self.time_increment_s),
            range_min_m=_single(self.range_min_m),
            range_max_m=_single(self.range_max_m),
        )


def _single(value: float) -> float:
    return float(np.float32(value))
