"""The plants that one set of gains must control: battery, load, and uncertainty of the identification."""

from dataclasses import replace

from thumper_tuning.design.loop_analysis import LoopMargins, Plant, loop_margins
from thumper_tuning.identify.model import MotorModel, Uncertainty

SUPPLY = (0.85, 1.0, 1.15)
INERTIA = (0.36, 1.0, 2.0)  # wheels up ... full load
SIGMAS = 2.0


def plant_family(model: MotorModel, std: Uncertainty) -> list[MotorModel]:
    """Return models with battery voltage +-15 %, inertia x0.36 ... x2, and 2 sigma off in each parameter."""
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


def worst_case_margins(
    model: MotorModel, std: Uncertainty, kp: float, ki: float, period_s: float
) -> LoopMargins:
    """Return the margins of the member of the family with the largest sensitivity."""
    margins = [
        loop_margins(Plant.from_model(member, period_s), kp, ki) for member in plant_family(model, std)
    ]
    return max(margins, key=lambda one: one.max_sensitivity)
