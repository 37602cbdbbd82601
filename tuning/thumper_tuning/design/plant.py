"""The discrete plant that the gains control: a wheel, from PWM to counted speed."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from thumper_tuning.identify.model import MotorModel

if TYPE_CHECKING:
    import control

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant:
    """y[k+1] = a y[k] + c0 u[k] + c1 u[k-1] + ..."""

    pole: float
    numerator: tuple[float, ...]  # c0, c1, ... [rad/s per PWM]
    period_s: float

    @classmethod
    def from_model(cls, model: MotorModel, period_s: float) -> "Plant":
        """Return the exact discrete plant of a motor."""
        pole, numerator = model.discretize(period_s)
        return cls(pole=pole, numerator=tuple(numerator.tolist()), period_s=period_s)

    @property
    def dc_gain(self) -> float:
        """Steady-state speed per drive."""
        return sum(self.numerator) / (1.0 - self.pole)

    def system(self) -> "control.TransferFunction":
        """Return the plant as a python-control system."""
        import control

        denominator = [1.0, -self.pole, *[0.0] * (len(self.numerator) - 1)]
        return control.tf(
            list(self.numerator), denominator, self.period_s, inputs=["u"], outputs=["y"], name="plant"
        )

    def response(self, z: ComplexArray) -> ComplexArray:
        """Return the frequency response at points of the unit circle."""
        numerator = np.zeros_like(z)
        for k, coefficient in enumerate(self.numerator):
            numerator = numerator + coefficient * z ** (-1 - k)
        result: ComplexArray = numerator / (1.0 - self.pole / z)
        return result
