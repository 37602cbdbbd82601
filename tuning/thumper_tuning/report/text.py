"""Results as lines of text, for the terminal and the web page."""

import math

from thumper_tuning.design.fixed_point import PARAMETER_SPECS
from thumper_tuning.design.gains import Design
from thumper_tuning.design.loops import SpeedLoop
from thumper_tuning.drive.verify import TrackingError, Verification
from thumper_tuning.identify.motor import IdentifiedMotor
from thumper_tuning.identify.partial_motor import PartialMotor
from thumper_tuning.logs.motor_log import DriveUnit

NOISE_SIGMAS = 2.0  # a smaller change of the tracking error is none
USEFUL_SENSITIVITY_CHANGE = 0.1  # of Ms
KIND_NAMES = {"random": "random switching"}
MAX_QUIET_SENSITIVITY = 2.0  # a worst-case Ms up to this needs no warning


def motor_lines(motor: IdentifiedMotor) -> list[str]:
    """Return the identified parameters, one per line, and the warnings."""
    model, std = motor.model, motor.uncertainty
    unit = motor.unit.name if motor.unit is DriveUnit.PWM else motor.unit.value
    kinds = ", ".join(
        f"{KIND_NAMES.get(kind, kind)} alone {percent:.1f}"
        for kind, percent in motor.fit_percent_by_kind.items()
    )
    directions = ", ".join(
        f"{direction} {found[0]:z.2f}" if found is not None else f"{direction} not determined"
        for direction, found in motor.friction_by_direction.items()
    )
    window = []
    if motor.fit.sensor_window_s is not None:
        window = [f"  sensor window    {motor.sensor_window_s:9.4f} ± {std.sensor_window_s:.4f} s"]
    return [
        f"{motor.name}: predicts held-out speeds to {motor.validation.fit_percent:.1f} %"
        + (f" ({kinds})" if kinds else ""),
        f"  gain             {model.gain:9.5f} ± {std.gain:.5f} rad/s per {unit}",
        f"  time constant    {model.time_constant_s:9.4f} ± {std.time_constant_s:.4f} s",
        f"  static friction  {model.friction:z9.2f} ± {std.friction:.2f} {unit} ({directions})",
        f"  delay            {model.delay_s:9.4f} ± {std.delay_s:.4f} s",
        *window,
        *[f"  note: {warning}" for warning in motor.warnings],
        *[f"  read {line}" for line in motor.columns],
    ]


def partial_lines(motor: PartialMotor) -> list[str]:
    """Return what the log determines, what it does not, and what to record next."""
    unit = motor.unit.name if motor.unit is DriveUnit.PWM else motor.unit.value
    delay = [f"  delay            {motor.delay_s:9.4f} ± {motor.delay_std_s:.4f} s"]
    if "delay_s" in motor.not_determined:
        delay = []
    found = [f"  time constant    {motor.time_constant_s:9.4f} ± {motor.time_constant_std_s:.4f} s", *delay]
    if motor.static is not None:
        model, std = motor.model, motor.static
        found = [
            f"  gain             {model.gain:9.5f} ± {std.gain:.5f} rad/s per {unit}",
            f"  static friction  {model.friction:z9.2f} ± {std.friction:.2f} {unit}",
        ]
    return [
        f"{motor.name}: the log determines a part of the model (it explains {motor.fit_percent:.0f} %)",
        *found,
        *[
            f"  speed            {s.speed_rad_s:9.3f} ± {s.std_rad_s:.3f} rad/s at {s.drive:.4g} {unit}"
            for s in motor.steady
        ],
        f"  not determined   {', '.join(motor.not_determined)}: {motor.reason}",
        f"  record next      {motor.record_next}",
        *[f"  note: {warning}" for warning in motor.warnings],
        *[f"  read {line}" for line in motor.columns],
    ]


def motor_summary(motor: IdentifiedMotor) -> list[str]:
    """Return the identified parameters in one line, and the warnings."""
    model, std = motor.model, motor.uncertainty
    return [
        f"{motor.name}: gain {model.gain:.5f} ± {std.gain:.5f} rad/s per PWM, time constant "
        f"{model.time_constant_s:.4f} ± {std.time_constant_s:.4f} s, static friction "
        f"{model.friction:z.1f} ± {std.friction:.1f} PWM; predicts {motor.validation.fit_percent:.1f} %",
        *[f"note: {warning}" for warning in motor.warnings],
    ]


def design_lines(design: Design) -> list[str]:
    """Return the gains, the loop's margins, and a warning if another load or battery reduces them."""
    wire = design.gains.wire_values()
    margins, worst, step = design.margins, design.worst_case, design.step_info
    units = {name: spec.unit.replace("^2", "²") for name, spec in PARAMETER_SPECS.items()}
    lines = [
        f"  {name:13} {value:9.4f} {units[name]:20} (stored as {wire[name]})"
        for name, value in design.gains.items()
    ]
    lines += [
        f"  Ms {margins.max_sensitivity:.2f} (other battery or load: up to {worst.max_sensitivity:.2f}), "
        f"gain margin {margins.gain_margin_dB:.1f} dB, phase margin {margins.phase_margin_deg:.0f}°, "
        f"delay margin {margins.delay_margin_s:.3f} s",
        f"  PI alone: settles in {step.settling_time_s:.2g} s, overshoot {step.overshoot_percent:.0f} %",
    ]
    if not worst.stable:
        lines.append(
            "  note: with another battery or load these gains make the loop unstable; choose a smaller Ms"
        )
    elif worst.max_sensitivity > MAX_QUIET_SENSITIVITY:
        lines.append(
            "  note: with another load or battery the loop comes near to ringing (worst Ms); "
            "`--ms 1.4` or a lower control rate leaves more margin"
        )
    return lines


def tracking_change(before: TrackingError, after: TrackingError) -> str:
    """Return how the tracking error of a ramp changed, or that the change is within its noise."""
    text = (
        f"tracking error at {before.acceleration_rad_s2:g} rad/s² {before.std_rad_s:.3f} → "
        f"{after.std_rad_s:.3f} rad/s"
    )
    if _change_rad_s(before, after) != 0.0:
        return text
    return f"{text}, no change beyond the noise of ±{_noise_rad_s(before, after):.3f}"


def deciding_change(before: Verification, after: Verification, *, better: bool) -> str:
    """Return the change of the ramp that improved most; of the one that improved least if none is better."""
    pairs = zip(before.tracking, after.tracking, strict=True)
    return tracking_change(*(min if better else max)(pairs, key=lambda pair: _change_rad_s(*pair)))


def _noise_rad_s(before: TrackingError, after: TrackingError) -> float:
    return NOISE_SIGMAS * math.hypot(before.std_error_rad_s, after.std_error_rad_s)


def _change_rad_s(before: TrackingError, after: TrackingError) -> float:
    """Return the change of the tracking error, 0 within its noise."""
    change_rad_s = after.std_rad_s - before.std_rad_s
    return change_rad_s if abs(change_rad_s) > _noise_rad_s(before, after) else 0.0


def is_better(before: Verification, after: Verification, design: Design) -> bool:
    """Return whether new gains are worth saving.

    They are if they track a ramp better, or lower Ms, and track none worse. An acceleration limit that the
    user changes is worth it, too.
    """
    old = before.gains
    changes = [_change_rad_s(b, a) for b, a in zip(before.tracking, after.tracking, strict=True)]
    old_margins = SpeedLoop.of_board(design.plant, old.kp, old.ki).margins()
    less_sensitive = old_margins.max_sensitivity - design.margins.max_sensitivity > USEFUL_SENSITIVITY_CHANGE
    useful = min(changes) < 0.0 or less_sensitive or after.gains.acceleration != old.acceleration
    return useful and max(changes) <= 0.0


def tracking_lines(verification: Verification) -> list[str]:
    """Return the tracking error, one line per ramp."""
    return [
        f"  ramp {t.acceleration_rad_s2:g} rad/s²: error mean {t.mean_rad_s:+.3f}, std "
        f"{t.std_rad_s:.3f} rad/s (a loop without preview: {t.no_preview_std_rad_s:.2f} at best)"
        for t in verification.tracking
    ]
