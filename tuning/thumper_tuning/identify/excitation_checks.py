"""Whether a log can support an answer at all; if not: why, and what to record instead."""

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.fit import Fit
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.segments import Segment
from thumper_tuning.logs.motor_log import BoolArray, DriveUnit, MotorLog
from thumper_tuning.logs.units import FULL_PWM, refusal

RECORD = (
    "record 20 s or more at 10 Hz or faster: steps to three levels forward and the same backward, with "
    "pauses, then random switching between two levels (`thumper tune record` drives exactly this)"
)
FEWEST_WINDOWS = 30
FEWEST_COUNTS = 30.0
SHORTEST_S = 3.0
CEILING_RATIO = 1.08
LEVEL_RATIO = 1.15  # two drive levels are different if they are this far apart
LARGEST_STD = {"gain": 0.15, "time_constant": 0.3}
POOR_FIT_PERCENT = 40.0
MOST_NEGATIVE = -0.2  # friction over the largest drive: what a crooked driver explains at most


def check_before(logs: list[MotorLog], stretches: list[Segment], *, one_direction: bool) -> None:
    """Refuse a log in which nothing happens that a motor could be known by.

    Raises
    ------
    ThumperError
        No excitation, no motion, one direction, one level, saturated or too short; with what to record.
    """
    name = logs[0].name
    drive = np.concatenate([s.drive for s in stretches]) if stretches else np.zeros(0)
    speed = np.concatenate([s.speed_rad_s for s in stretches]) if stretches else np.zeros(0)
    length_s = sum(float(s.edge_s[-1] - s.edge_s[0]) for s in stretches)
    if len(speed) < FEWEST_WINDOWS or length_s < SHORTEST_S:
        raise refusal(f"{name}: {len(speed)} samples in {length_s:.1f} s are too few; {RECORD}")
    unit = logs[0].drive_unit.value
    if np.ptp(drive) == 0.0 and (len(stretches) == 1 or drive[0] == 0.0):
        raise refusal(f"{name}: no excitation: the drive is {drive[0]:g} {unit} all the time; {RECORD}")
    quantum = max(log.quantum_rad for log in logs)
    moving = np.abs(speed) > max(0.02 * float(np.percentile(np.abs(speed), 95)), 1e-9)
    travelled_rad = sum(float(np.abs(s.speed_rad_s) @ s.windows_s) for s in stretches)
    if not moving.any() or travelled_rad < FEWEST_COUNTS * quantum:
        raise refusal(
            f"{name}: the wheel does not move ({np.abs(drive).max():g} {unit} at most); drive it beyond "
            f"the dead band, check motor and encoder cables; {RECORD}"
        )
    _check_directions(name, drive, speed, moving, one_direction)
    _check_levels(name, logs[0].drive_unit, drive)
    if logs[0].position_rad is None:  # counts cannot be cut off
        for group in (*([s] for s in stretches), stretches):
            _check_ceiling(name, group)


def _check_directions(
    name: str, drive: FloatArray, speed: FloatArray, moving: BoolArray, allowed: bool
) -> None:
    usual = float(np.percentile(np.abs(speed[moving]), 75))
    forward, backward = float(np.mean(speed > 0.2 * usual)), float(np.mean(speed < -0.2 * usual))
    if min(forward, backward) >= 0.04 or allowed:
        return
    if (drive < 0).any() and (drive > 0).any():
        raise refusal(
            f"{name}: the drive has both signs but the speed only one: the log lacks the sign of the speed; "
            "record counts that rise forward and fall backward"
        )
    raise refusal(
        f"{name}: one direction only: gain and static friction can hardly be told apart, and the other "
        f"direction's friction not at all; {RECORD}; or give --one-direction to have this direction alone"
    )


def _check_levels(name: str, unit: DriveUnit, drive: FloatArray) -> None:
    driven = np.sort(np.abs(drive[np.abs(drive) > 0.05 * np.abs(drive).max()]))
    low, high = float(np.percentile(driven, 5)), float(np.percentile(driven, 95))
    if high >= LEVEL_RATIO * low:
        return
    full = unit is DriveUnit.PWM and high >= 0.98 * FULL_PWM
    what = "saturated: the drive is at its limit" if full else "one drive level only"
    raise refusal(
        f"{name}: {what} ({high:g} {unit.value}) all the time it drives: gain and static friction "
        f"cannot be told apart; {RECORD}"
    )


def _check_ceiling(name: str, stretches: list[Segment]) -> None:
    """A speed that stays at its largest value while the drive moves on was cut off by who wrote it."""
    speed = np.abs(np.concatenate([s.speed_rad_s for s in stretches]))
    top = speed >= speed.max() * (1.0 - 1e-9)
    if top.mean() < 0.08 or max(s.quantum_rad_s for s in stretches) > 0.03 * speed.max():
        return
    drive = np.abs(np.concatenate([_drive_at(s) for s in stretches]))[top]
    if np.percentile(drive, 95) > CEILING_RATIO * np.percentile(drive, 20):
        raise refusal(
            f"{name}: the speed is saturated: it stays at {speed.max():g} rad/s while the drive rises on; "
            "log it with a wider range, or log the counts"
        )


def _drive_at(s: Segment) -> FloatArray:
    """The drive at the begin of each window."""
    return s.drive[np.clip(np.searchsorted(s.change_s, s.edge_s[:-1] + 1e-9, side="right") - 1, 0, None)]


def check_after(name: str, fit: Fit, fit_percent: float, unit: DriveUnit, largest_drive: float) -> None:
    """Refuse an answer that its own uncertainty denies.

    Raises
    ------
    ThumperError
        A parameter is not determined or impossible, or the model does not describe the log.
    """
    model, std = fit.model, fit.uncertainty
    if fit_percent < POOR_FIT_PERCENT:
        raise refusal(
            f"{name}: the model explains only {max(fit_percent, 0.0):.0f} % of held-out speeds: check "
            f"units, sign and that each row holds the drive applied until the next; else {RECORD}"
        )
    if model.friction < MOST_NEGATIVE * largest_drive:
        raise refusal(
            f"{name}: the static friction comes out at {model.friction:.3g} {unit.value}: at high drive the "
            "speed hardly follows, it is cut off or limited; log the counts, or record at lower levels"
        )
    loose = _loose(model, std)
    if loose:
        raise refusal(f"{name}: the log does not determine the {loose} (rad/s per {unit.value}); {RECORD}")


def _loose(model: MotorModel, std: Uncertainty) -> str:
    if std.gain > LARGEST_STD["gain"] * model.gain:
        return f"gain: {model.gain:.3g} +- {std.gain:.2g}"
    if std.time_constant_s > max(LARGEST_STD["time_constant"] * model.time_constant_s, 0.004):
        return f"time constant: {model.time_constant_s:.3g} +- {std.time_constant_s:.2g} s"
    return ""
