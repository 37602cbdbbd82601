"""The plants that one set of gains must control: battery, load, and uncertainty of the identification."""

from dataclasses import replace

from thumper_tuning.design.fast_sensitivity import max_sensitivity
from thumper_tuning.design.loops import LoopMargins, SpeedLoop
from thumper_tuning.design.plant import Plant
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
    plants = [Plant.from_model(member, period_s) for member in plant_family(model, std)]
    worst = max(plants, key=lambda plant: max_sensitivity(plant, kp, ki))
    return SpeedLoop.of_board(worst, kp, ki).margins()
