"""Check units: reject values that cannot be in the unit that their column name states."""

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray
from thumper_tuning.logs.motor_log import DriveUnit

FULL_PWM = 255.0
NOMINAL_V = 7.4  # the board's feed-forward gains refer to this battery voltage
MAX_PERIOD_S = 2.0
MAX_VOLTAGE_V = 100.0
MAX_SPEED_RAD_S = 5000.0


def check_time(time_s: FloatArray, header: str) -> None:
    """Reject a time column that does not increase, or whose period no motor log can have."""
    steps = np.diff(time_s)
    period_s = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    if period_s == 0.0:
        raise log_error(f"column {header!r} does not increase; it must be the time of each row")
    if period_s > MAX_PERIOD_S:
        unit, name = ("milliseconds", "time_ms") if period_s < 2000.0 else ("microseconds", "time_us")
        raise log_error(
            f"column {header!r} increases by {period_s:g} s per row, too slow for any motor; if these are "
            f"{unit}, name the column {name}; else record at 10 Hz or faster"
        )
    if period_s < 1e-5:
        raise log_error(
            f"column {header!r} increases by {period_s:g} s per row; if its unit differs from its name, "
            "rename it (time_s, time_ms, time_us)"
        )


def check_drive(drive: FloatArray, unit: DriveUnit, header: str) -> str:
    """Reject a drive in the wrong unit; return a warning, or an empty string."""
    largest = float(np.nanmax(np.abs(drive))) if np.isfinite(drive).any() else 0.0
    if unit is DriveUnit.VOLT:
        if largest > MAX_VOLTAGE_V:
            raise log_error(
                f"column {header!r} reaches {largest:g} V; name it pwm if it is PWM, voltage_mV if it is mV"
            )
        return ""
    if 0.0 < largest <= 1.0:
        raise log_error(
            f"column {header!r} stays within +-{largest:g}: a duty ratio, not PWM of 255; name it duty, "
            f"or pass --column drive={header}:duty"
        )
    if largest > FULL_PWM:
        return f"pwm reaches {largest:g}, beyond 255: values used as they are; gains are per unit of pwm"
    return ""


def check_speed(speed_rad_s: FloatArray, period_s: float, counts_per_rev: float, header: str) -> None:
    """Reject speeds that no motor reaches, or whose quantization reveals another unit."""
    largest = float(np.nanmax(np.abs(speed_rad_s))) if np.isfinite(speed_rad_s).any() else 0.0
    if largest > MAX_SPEED_RAD_S:
        raise log_error(
            f"column {header!r} reaches {largest:g} rad/s; put its unit in the name: speed_rpm, speed_deg_s, "
            "speed_counts_s"
        )
    if header.strip().lower() not in ("speed_rad_s", "speed (rad/s)", "speed [rad/s]"):
        return
    quantum = quantization_step(speed_rad_s)
    count_rad_s = 2.0 * np.pi / (counts_per_rev * period_s)
    for name, factor in (("speed_rpm", 30.0 / np.pi), ("speed_deg_s", 180.0 / np.pi)):
        if quantum > 0.0 and abs(quantum / (count_rad_s * factor) - 1.0) < 0.005:
            raise log_error(
                f"column {header!r} changes in steps of {quantum:.4g}: one encoder count in "
                f"{name.removeprefix('speed_')}, not in rad/s ({count_rad_s:.4g}); name it {name}"
            )


def quantization_step(values: FloatArray) -> float:
    """Return the step that all values are multiples of, or 0 if there is none."""
    levels = np.unique(np.round(np.abs(values[np.isfinite(values)]), 9))
    steps = np.diff(levels)
    steps = steps[steps > 1e-6 * max(float(levels[-1]), 1e-12)] if len(levels) > 2 else steps
    if len(steps) < 3:
        return 0.0
    quantum = float(np.median(steps[steps < 1.5 * steps.min()]))
    off_grid = np.abs(levels / quantum - np.round(levels / quantum))
    return quantum if float(np.max(off_grid)) < 0.05 else 0.0


def log_error(message: str) -> ThumperError:
    """Return the error for a file that is no log; its message says what to record or rename."""
    return ThumperError(message, exit_code=EXIT_USAGE)
