"""The identified motor as JSON."""

from typing import Any

from thumper_tuning.identify.motor import IdentifiedMotor

NOT_IDENTIFIABLE = (
    "drive and speed determine only gain, time constant, static friction and delay. R, L, Kt, Kf, J and B "
    "appear only in combinations; pass --resistance and log current_A to separate them"
)


def motor_to_dict(motor: IdentifiedMotor) -> dict[str, Any]:
    """Return plain values; keys carry their units, and every parameter has its `_std`."""
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
