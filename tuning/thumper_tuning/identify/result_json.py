"""The identified motor as JSON."""

from typing import Any

from thumper_tuning.identify.motor import IdentifiedMotor
from thumper_tuning.identify.partial_motor import PartialMotor

NOT_IDENTIFIABLE = (
    "drive and speed determine only gain, time constant, static friction and delay. R, L, Kt, Kf, J and B "
    "appear only in combinations; pass --resistance and log current_A to separate them"
)


def motor_to_dict(motor: IdentifiedMotor) -> dict[str, Any]:
    """Return plain values; keys carry their units, and every parameter has its `_std`.

    None: not determined.
    """
    model, std, unit = motor.model, motor.uncertainty, motor.unit.value
    return {
        "motor": motor.name,
        f"gain_rad_s_per_{unit}": model.gain,
        f"gain_rad_s_per_{unit}_std": std.gain,
        "time_constant_s": model.time_constant_s,
        "time_constant_s_std": std.time_constant_s,
        f"static_friction_{unit}": model.friction,
        f"static_friction_{unit}_std": std.friction,
        **{
            f"static_friction_{direction}_{unit}{suffix}": found[k] if found is not None else None
            for direction, found in motor.friction_by_direction.items()
            for k, suffix in enumerate(("", "_std"))
        },
        "breakaway_ratio": model.breakaway_ratio,
        "delay_s": model.delay_s,
        "delay_s_std": std.delay_s,
        "sensor_window_s": motor.sensor_window_s,
        "sensor_window_s_std": std.sensor_window_s,
        "fit_percent": motor.validation.fit_percent,
        "fit_percent_by_kind": motor.fit_percent_by_kind,
        "period_s": motor.period_s,
        "supply_V": motor.supply_V,
        "warnings": list(motor.warnings),
        "columns": list(motor.columns),
    }


def partial_to_dict(motor: PartialMotor) -> dict[str, Any]:
    """Return what a log determines, with the keys of `motor_to_dict`, and what it does not."""
    unit = motor.unit.value
    has_delay = "delay_s" not in motor.not_determined
    has_lag = motor.static is None
    static = {}
    if motor.static is not None:
        static = {
            f"gain_rad_s_per_{unit}": motor.model.gain,
            f"gain_rad_s_per_{unit}_std": motor.static.gain,
            f"static_friction_{unit}": motor.model.friction,
            f"static_friction_{unit}_std": motor.static.friction,
        }
    return {
        "motor": motor.name,
        **static,
        "time_constant_s": motor.time_constant_s if has_lag else None,
        "time_constant_s_std": motor.time_constant_std_s if has_lag else None,
        "delay_s": motor.delay_s if has_delay else None,
        "delay_s_std": motor.delay_std_s if has_delay else None,
        "steady": [
            {f"drive_{unit}": s.drive, "speed_rad_s": s.speed_rad_s, "speed_rad_s_std": s.std_rad_s}
            for s in motor.steady
        ],
        "fit_percent": motor.fit_percent,
        "not_determined": list(motor.not_determined),
        "reason": motor.reason,
        "record_next": motor.record_next,
        "warnings": list(motor.warnings),
        "columns": list(motor.columns),
    }
