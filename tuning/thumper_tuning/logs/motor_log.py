"""One motor's log in order: rising time, SI units, unwrapped position, and where it breaks off."""

from dataclasses import dataclass
from enum import Enum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray

BoolArray = NDArray[np.bool_]


class DriveUnit(Enum):
    """What drives the motor; the value is the suffix of every name that carries the unit."""

    PWM = "pwm"
    VOLT = "V"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotorLog:
    """What one motor was told and what it did. All arrays have shape (n,).

    `drive[k]` is applied from `time_s[k]` until the next row. Exactly one of position and speed is there;
    a NaN in it is a row without a measurement. `speed_rad_s[k]` belongs to the interval that ends at row k.
    """

    name: str
    drive_unit: DriveUnit
    time_s: FloatArray
    drive: FloatArray
    begins: BoolArray  # a stretch begins here: the first row, and each row after a gap
    position_rad: FloatArray | None = None
    speed_rad_s: FloatArray | None = None
    quantum_rad: float = 0.0  # of the position; 0 = not known
    current_A: FloatArray | None = None
    supply_V: float | None = None  # mean battery voltage that the drive in PWM refers to
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if (self.position_rad is None) == (self.speed_rad_s is None):
            raise ValueError("a motor log holds either positions or speeds")

    @property
    def period_s(self) -> float:
        """The usual time between two rows [s]."""
        return float(np.median(np.diff(self.time_s)[~self.begins[1:]]))

    @property
    def stretches(self) -> list[slice]:
        """The rows of each stretch without a gap."""
        edges = [*np.flatnonzero(self.begins).tolist(), len(self.time_s)]
        return [slice(first, last) for first, last in pairwise(edges)]
