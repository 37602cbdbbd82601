"""Guess the units that headers do not name, by the size of the values, and say so."""

import math
from dataclasses import replace

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.logs.column_names import POSITIONS_RAD, UNITS, Quantity
from thumper_tuning.logs.columns import Column
from thumper_tuning.logs.encoder_counts import look_like_counts_per_row
from thumper_tuning.logs.roles import MotorColumns

USUAL_PERIOD_S = 0.03
MIN_PERIOD_S, MAX_PERIOD_S = 2e-4, 2.0
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
PERCENT = UNITS[Quantity.PWM]["%"]


def with_guessed_units(columns: MotorColumns, values: FloatArray) -> tuple[MotorColumns, list[str]]:
    """Return the columns with the units that the values suggest, and a warning for each guess.

    A time in seconds, a duty ratio and counts need none. `values` is the table, shape (n, columns).
    """
    is_like_speed = look_like_counts_per_row(
        values[:, columns.output.index], values[:, columns.drive.index] * columns.drive.scale
    )
    found = {"time": _time, "drive": _drive, "output": _speed if is_like_speed else _output}
    notes = []
    for role, guess in found.items():
        column: Column = getattr(columns, role)
        if column.weak:
            notes.append(f"column {column.header!r} is taken as {role} by its last words")
        if column.unit_given:
            continue
        known = values[:, column.index][np.isfinite(values[:, column.index])]
        guessed, unit = guess(column, known)
        columns = replace(columns, **{role: guessed})
        if unit and role == "time":
            notes.append(f"column {column.header!r} names no unit: read as {unit}, by the rate of the rows")
        elif unit:
            notes.append(
                f"column {column.header!r} names no unit: read as {unit}; else pass --column "
                f"{role}={column.header}:UNIT"
            )
    return columns, notes


def _time(column: Column, values: FloatArray) -> tuple[Column, str]:
    name, scale = guess_time_unit(values)
    return (column, "") if name == "s" else (replace(column, scale=scale), name)


def _drive(column: Column, values: FloatArray) -> tuple[Column, str]:
    """Return PWM, or for a duty cycle the ratio, percent or PWM that its largest value suggests."""
    largest = float(np.abs(values).max(initial=0.0))
    if column.scale == 1.0:
        return column, "PWM of 255"
    if largest <= 1.0:
        return column, ""
    scale, unit = (PERCENT, "%") if largest <= 100.0 else (1.0, "PWM of 255")
    return replace(column, scale=scale), unit


def _output(column: Column, values: FloatArray) -> tuple[Column, str]:
    """Return counts if all values are whole, else rad; a speed keeps the unit of its name, or rad/s."""
    if column.quantity is Quantity.SPEED:
        return column, "rpm" if column.scale == UNITS[Quantity.SPEED]["rpm"] else "rad/s"
    if column.quantity is not Quantity.COUNTS or (values == np.round(values)).all():
        return column, ""
    return replace(column, scale=POSITIONS_RAD["rad"] / math.tau, needs_encoder=False), "rad"


def _speed(column: Column, values: FloatArray) -> tuple[Column, str]:
    """Return rad/s for what follows the drive as a speed does, unless it may be counts per row."""
    if column.quantity is not Quantity.COUNTS or (values == np.round(values)).all():
        return _output(column, values)
    speed = replace(column, quantity=Quantity.SPEED, scale=1.0, needs_encoder=False)
    return speed, "rad/s, because it follows the drive like a speed"


def guess_time_unit(values: FloatArray) -> tuple[str, float]:
    """Return the unit whose median period is nearest to 30 ms on a logarithmic scale, and its seconds.

    Seconds stay seconds if the period is 0.2 ms ... 1 s: a column of seconds needs no guess.
    """
    steps = np.diff(values)
    steps = steps[np.isfinite(steps) & (steps > 0.0)]
    if not steps.size:
        return "s", 1.0
    period = float(np.median(steps))
    if MIN_PERIOD_S <= period < 1.0:
        return "s", 1.0
    plausible = {
        name: scale for name, scale in TIME_UNITS.items() if MIN_PERIOD_S <= period * scale <= MAX_PERIOD_S
    }
    if not plausible:
        return "s", 1.0
    name = min(plausible, key=lambda unit: abs(math.log(period * plausible[unit] / USUAL_PERIOD_S)))
    return name, plausible[name]
