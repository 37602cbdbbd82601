"""One line per used column: what was understood, for the user to check."""

import math
from collections.abc import Iterator

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.logs.column_names import POSITIONS_RAD, Quantity
from thumper_tuning.logs.column_names import UNITS as SCALES
from thumper_tuning.logs.columns import Column
from thumper_tuning.logs.roles import MotorColumns

UNITS = {
    Quantity.TIME: "s",
    Quantity.PWM: "PWM of 255",
    Quantity.VOLTAGE: "V",
    Quantity.SPEED: "rad/s",
    Quantity.CURRENT: "A",
    Quantity.BATTERY: "V",
    Quantity.DIRECTION: "sign of the drive",
    Quantity.SETPOINT: "not used: only shows that the log is of a closed loop",
}


def preview(
    headers: tuple[str, ...], columns: MotorColumns, values: dict[Column, FloatArray]
) -> Iterator[str]:
    """Yield the role, header, unit and range of each used column, and the headers that are not used."""
    for role, column in columns.used:
        known = values[column][np.isfinite(values[column])]
        if not known.size:
            continue
        if role == "time":
            steps_s = np.diff(known)
            what = (
                f"s, every {1e3 * float(np.median(steps_s[steps_s > 0.0], axis=None)):.3g} ms"
                if (steps_s > 0.0).any()
                else "s"
            )
        else:
            known = known * math.tau if _is_angle(column) else known
            what = f"{_unit(column)}, {known.min():.4g} ... {known.max():.4g}"
        yield f"{role}: column {column.header!r} [{what}]"
    used = {column.index for _, column in columns.used}
    if ignored := [header for i, header in enumerate(headers) if i not in used and header.strip()]:
        yield f"not used: {', '.join(ignored)}"


def _is_angle(column: Column) -> bool:
    """Return whether a column holds angles; their values are in revolutions."""
    return column.quantity is Quantity.COUNTS and not column.needs_encoder


def _unit(column: Column) -> str:
    if _is_angle(column):
        rad = column.scale * math.tau
        written = next(name for name, scale in POSITIONS_RAD.items() if math.isclose(scale, rad))
        return "rad" if written == "rad" else f"{written}, read as rad"
    if column.quantity is Quantity.COUNTS_PER_ROW:
        return "counts per row"
    if column.quantity is Quantity.COUNTS:
        return "counts"
    if column.needs_encoder:
        return "counts/s"
    unit = UNITS[column.quantity]
    if column.quantity is not Quantity.SPEED or column.scale == 1.0:
        return unit
    written = next(name for name, scale in SCALES[Quantity.SPEED].items() if scale == column.scale)
    return f"{written.replace(' s', '/s')}, read as {unit}"
