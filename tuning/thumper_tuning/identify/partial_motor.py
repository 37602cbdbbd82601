"""What a log determines that does not determine the whole model."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from thumper_tuning.identify.excitation_checks import RECORD, UndeterminedError
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.systems import continuous_system, counted_system
from thumper_tuning.logs.motor_log import DriveUnit

if TYPE_CHECKING:
    import control

RECORD_NEXT = f"{RECORD[0].upper()}{RECORD[1:]}."


@dataclass(frozen=True, slots=True, kw_only=True)
class SteadySpeed:
    """Speed that a drive leads to."""

    drive: float
    speed_rad_s: float
    std_rad_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PartialMotor:
    """What the log determines, and what it does not."""

    name: str
    unit: DriveUnit
    # Linear: from the drive to the speed that it leads to, at the recorded level only. With `static`: with
    # friction, but of no meaning in time constant and delay.
    model: MotorModel
    time_constant_std_s: float
    delay_std_s: float  # inf: the delay is not determined
    period_s: float
    steady: tuple[SteadySpeed, ...]
    fit_percent: float  # of the fitted windows: too little data to hold out
    warnings: tuple[str, ...]
    not_determined: tuple[str, ...]
    reason: str  # why not
    record_next: str
    columns: tuple[str, ...]
    static: Uncertainty | None = None  # of slow ramps: the model's gain and friction are determined, no lag

    @property
    def time_constant_s(self) -> float:
        """The time constant."""
        return self.model.time_constant_s

    @property
    def delay_s(self) -> float:
        """From drive to motion; 0: indistinguishable from none."""
        return self.model.delay_s

    def continuous(self) -> "control.TransferFunction":
        """Return the continuous python-control system of the recorded level."""
        return continuous_system(self.model)

    def counted(self, period_s: float) -> "control.TransferFunction":
        """Return the discrete system of the recorded level, to the speed that is counted per period."""
        return counted_system(self.model, period_s)


def why_partly(reason: UndeterminedError, name: str) -> str:
    """Return why a log does not determine the whole model, without the motor's name and what to record."""
    return str(reason).split(";")[0].removeprefix(f"{name}: ")
