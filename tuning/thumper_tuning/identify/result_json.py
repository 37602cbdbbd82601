"""What is known of a motor, as JSON and as text."""

from typing import Any

from thumper_tuning.identify.motor import Identified

NOT_IDENTIFIABLE = (
    "from drive and speed follow gain, time constant, static friction and delay, and no more: R, L, Kt, "
    "Kf, J and B enter only in combinations; give --resistance, and log current_A, to have them apart"
)


def as_dict(motor: Identified) -> dict[str, Any]:
    """Plain values, keys with their units; every parameter has its `_std`."""
    model, std, unit = motor.model, motor.uncertainty, motor.unit.value
    return {
        "motor": motor.name,
        f"gain_rad_s_per_{unit}": model.gain,
        f"gain_rad_s_per_{unit}_std": std.gain,
        "time_constant_s": model.time_constant_s,
        "time_constant_s_std": std.time_constant_s,
        f"static_friction_{unit}": model.friction,
        f"static_friction_{unit}_std": std.friction,
        f"static_friction_forward_{unit}": model.friction_forward,
        f"static_friction_forward_{unit}_std": std.friction_forward,
        f"static_friction_backward_{unit}": model.friction_backward,
        f"static_friction_backward_{unit}_std": std.friction_backward,
        "breakaway_ratio": model.breakaway_ratio,
        "delay_s": model.delay_s,
        "delay_s_std": std.delay_s,
        "fit_percent": motor.validation.fit_percent,
        "period_s": motor.period_s,
        "supply_V": motor.supply_V,
        "warnings": list(motor.warnings),
    }
