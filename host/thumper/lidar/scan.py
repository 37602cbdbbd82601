"""One turn of a 2-D lidar, as every sensor driver delivers it and every consumer takes it."""

from dataclasses import dataclass

import numpy as np

from thumper.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """Ranges in the laser frame, beam 0 first in time; beam i points at angle_min + i * angle_increment.

    `ranges_m` has shape (n,). NaN: invalid; +inf: nothing seen up to `range_max_m` (REP-117). A negative
    `angle_increment_rad` is a sensor that turns clockwise. `time_s` is when beam 0 was measured, on the
    host's clock.
    """

    time_s: float
    ranges_m: FloatArray
    angle_min_rad: float
    angle_increment_rad: float
    time_increment_s: float = 0.0
    range_min_m: float = 0.02
    range_max_m: float = 5.6

    def angles_rad(self) -> FloatArray:
        """Direction of each beam in the laser frame, shape (n,)."""
        steps = np.arange(self.ranges_m.size, dtype=np.float64)
        return np.asarray(self.angle_min_rad + self.angle_increment_rad * steps, dtype=np.float64)
