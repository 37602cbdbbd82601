"""The plants that one set of gains must serve: battery, load and what the identification is unsure of."""

from dataclasses import replace

from thumper_tuning.design.loop_analysis import LoopFigures, Plant, judge
from thumper_tuning.identify.model import MotorModel, Uncertainty

SUPPLY = (0.85, 1.0, 1.15)
INERTIA = (0.36, 1.0, 2.0)  # wheels up ... full load
SIGMAS = 2.0


def family(model: MotorModel, std: Uncertainty) -> list[MotorModel]:
    """Battery voltage +-15 %, inertia x0.36 ... x2, each with gain and time constant 2 sigma off."""
    return [
        replace(
            model,
            gain=supply * (model.gain + side * SIGMAS * std.gain),
            time_constant_s=inertia * max(model.time_constant_s + side * SIGMAS * std.time_constant_s, 1e-3),
        )
        for supply in SUPPLY
        for inertia in INERTIA
        for side in (-1.0, 0.0, 1.0)
    ]


def worst(model: MotorModel, std: Uncertainty, kp: float, ki: float, period_s: float) -> LoopFigures:
    """The family's least damped loop."""
    figures = [judge(Plant.of(member, period_s), kp, ki) for member in family(model, std)]
    return max(figures, key=lambda figure: figure.sensitivity)
