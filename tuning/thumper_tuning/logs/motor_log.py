"""The log of one motor: rows in time order, SI units, unwrapped position, and where the log is cut."""

from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray

BoolArray = NDArray[np.bool_]


class DriveUnit(Enum):
    """Unit of the drive. The value is the suffix of every name that carries the unit."""

    PWM = "pwm"
    VOLT = "V"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotorLog:
    """Drive and measured motion of one motor. All arrays have shape (n,).

    `drive[k]` is applied from `time_s[k]` until the next row. A log has either positions or speeds, and NaN
    where a row has no measurement. `speed_rad_s[k]` belongs to the interval that ends at row k.
    """

    name: str
    drive_unit: DriveUnit
    time_s: FloatArray
    drive: FloatArray
    starts_segment: BoolArray  # True for the first row, and for each row after a gap
    position_rad: FloatArray | None = None
    speed_rad_s: FloatArray | None = None
    quantum_rad: float = 0.0  # position per encoder count; 0: unknown
    current_A: FloatArray | None = None
    supply_V: float | None = None  # mean battery voltage that a drive in PWM refers to
    opens_at_zero: bool = False  # a drive of 0 V is an open bridge; at PWM 0 it always counts as one
    has_setpoint: bool = False  # recorded in closed loop
    columns: tuple[str, ...] = ()  # what was understood, one line per used column
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if (self.position_rad is None) == (self.speed_rad_s is None):
            raise ValueError("a motor log has either positions or speeds")

    @property
    def period_s(self) -> float:
        """Median time between two measurements [s]."""
        measured = self.speed_rad_s if self.position_rad is None else self.position_rad
        assert measured is not None
        return median_period_s(self.time_s, self.starts_segment, np.isfinite(measured))

    @property
    def segments(self) -> list[slice]:
        """The rows of each segment without a gap."""
        edges = [*np.flatnonzero(self.starts_segment).tolist(), len(self.time_s)]
        return [slice(first, last) for first, last in pairwise(edges)]


def median_period_s(time_s: FloatArray, starts_segment: BoolArray, measured: BoolArray) -> float:
    """Return the median time between two rows with a measurement, without gaps [s]."""
    rows = np.flatnonzero(measured)
    segment = np.cumsum(starts_segment)[rows]
    steps = np.diff(time_s[rows])[np.diff(segment) == 0]
    return float(np.median(steps if len(steps) else np.diff(time_s)))
