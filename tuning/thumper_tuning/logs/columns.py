"""Recognize the columns of any motor log by their headers: quantity, unit and wheel."""

import math
import re
from dataclasses import dataclass
from enum import Enum
from functools import partial

from thumper.common.errors import EXIT_CHECK_FAILED, ThumperError

MAX_HEADER_LENGTH = 60


class Quantity(Enum):
    """Quantity that a column holds."""

    TIME = "time"
    PWM = "pwm"
    VOLTAGE = "voltage"
    COUNTS = "counts"
    COUNTS_PER_ROW = "counts_per_row"
    SPEED = "speed"
    CURRENT = "current"
    BATTERY = "battery"


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A recognized column. `scale` converts it to SI units, but leaves counts as counts."""

    index: int
    header: str
    quantity: Quantity
    scale: float
    motor: str  # empty: common to all motors
    needs_encoder: bool = False  # in counts: the encoder's resolution is needed


# Names are matched as whole words, longest first, after the wheel is removed. The other words are the unit.
NAMES = {
    Quantity.TIME: (
        "time",
        "t",
        "timestamp",
        "stamp",
        "zeit",
        "tijd",
        "elapsed",
        "clock",
        "millis",
        "micros",
    ),
    Quantity.PWM: ("pwm", "duty", "dutycycle", "u", "command", "cmd", "drive", "input"),
    Quantity.VOLTAGE: ("voltage", "volt", "volts", "v", "uin", "vin", "vm", "motor voltage", "input voltage"),
    Quantity.COUNTS: (
        "counts",
        "count",
        "ticks",
        "tick",
        "encoder",
        "enc",
        "position",
        "pos",
        "steps",
        "pulses",
        "angle",
        "theta",
    ),
    Quantity.COUNTS_PER_ROW: (
        "delta counts",
        "counts delta",
        "counts per row",
        "dcounts",
        "delta ticks",
        "dticks",
    ),
    Quantity.SPEED: (
        "speed",
        "velocity",
        "omega",
        "vel",
        "w",
        "rate",
        "rpm",
        "angular velocity",
        "wheel speed",
    ),
    Quantity.CURRENT: ("current", "i", "amps"),
    Quantity.BATTERY: ("battery", "vbat", "supply", "battery voltage", "vbatt", "bus voltage"),
}
UNITS: dict[Quantity, dict[str, float]] = {
    Quantity.TIME: {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "millis": 1e-3, "us": 1e-6, "µs": 1e-6,
                    "micros": 1e-6, "ns": 1e-9, "min": 60.0},
    Quantity.PWM: {"": 1.0, "pwm": 1.0, "%": 2.55, "percent": 2.55, "duty": 255.0, "dutycycle": 255.0},
    Quantity.VOLTAGE: {"v": 1.0, "volt": 1.0, "volts": 1.0, "mv": 1e-3},
    Quantity.COUNTS: {"": 1.0, "rad": math.nan, "deg": math.nan, "rev": math.nan},
    Quantity.SPEED: {"rad s": 1.0, "rads": 1.0, "radps": 1.0, "mrad s": 1e-3, "deg s": math.pi / 180.0,
                     "rpm": math.pi / 30.0, "rps": math.tau, "rev s": math.tau, "hz": math.tau},
    Quantity.CURRENT: {"a": 1.0, "ma": 1e-3},
    Quantity.BATTERY: {"v": 1.0, "mv": 1e-3},
}  # fmt: skip
COUNT_SPEEDS = ("steps s", "counts s", "ticks s", "count s", "cps", "pulses s")
POSITIONS_RAD = {"rad": 1.0, "deg": math.pi / 180.0, "rev": math.tau}
SIDES = ("left", "right", "l", "r", "front", "rear", "fl", "fr", "rl", "rr", "m1", "m2", "m3", "m4")
LONG_SIDES = {"l": "left", "r": "right"}


def parse_header(header: str, index: int) -> Column | None:
    """Recognize a header such as `left_speed_rad_s`, `Voltage (V)` or `u [mV]`; None if unknown.

    Raises
    ------
    ThumperError
        The quantity is known, but its unit is not.
    """
    words = _words(header)
    sides = [word for word in words if word in SIDES]
    motor = LONG_SIDES.get(sides[0], sides[0]) if sides else ""
    words = [word for word in words if word not in SIDES] if sides and len(words) > 1 else words
    for cut in range(len(words), 0, -1):
        name, unit = " ".join(words[:cut]), " ".join(words[cut:])
        for quantity, names in NAMES.items():
            if name in names and (column := _with_unit(header, index, quantity, name, unit, motor)):
                return column
    return None


def _with_unit(
    header: str, index: int, quantity: Quantity, name: str, unit: str, motor: str
) -> Column | None:
    column = partial(Column, index=index, header=header, motor=motor)
    if special := _special_column(column, quantity, unit):
        return special
    if quantity is Quantity.COUNTS_PER_ROW:
        return None
    units = UNITS[quantity]
    unit = _unit_or_default(quantity, name, unit)
    if unit not in units:
        if not header.isprintable() or len(header) > MAX_HEADER_LENGTH:
            return None
        if quantity in (Quantity.CURRENT, Quantity.BATTERY):
            return None  # optional columns are ignored instead
        raise ThumperError(
            f"column {header!r}: unknown unit {unit!r}; rename it, for example to "
            f"{quantity.value}_{next(iter(units)).replace(' ', '_') or 'raw'}",
            exit_code=EXIT_CHECK_FAILED,
        )
    if quantity is Quantity.COUNTS and unit in POSITIONS_RAD:
        return column(quantity=quantity, scale=POSITIONS_RAD[unit] / math.tau)
    return column(quantity=quantity, scale=units[unit], needs_encoder=quantity is Quantity.COUNTS)


def _special_column(column: "partial[Column]", quantity: Quantity, unit: str) -> Column | None:
    """Recognize units that change the quantity: counts per second, counts per row, PWM in volts."""
    if quantity is Quantity.COUNTS_PER_ROW and not unit:
        return column(quantity=quantity, scale=1.0)
    if quantity is Quantity.COUNTS and unit in ("s", "sec"):
        return column(quantity=Quantity.SPEED, scale=1.0, needs_encoder=True)
    if quantity is Quantity.COUNTS and unit in ("delta", "diff", "per row", "per interval", "per period"):
        return column(quantity=Quantity.COUNTS_PER_ROW, scale=1.0)
    if quantity is Quantity.PWM and unit in ("v", "mv"):  # "u [V]", "command_V"
        return column(quantity=Quantity.VOLTAGE, scale=UNITS[Quantity.VOLTAGE][unit])
    if quantity is Quantity.SPEED and unit in COUNT_SPEEDS:
        return column(quantity=quantity, scale=1.0, needs_encoder=True)
    return None


def _unit_or_default(quantity: Quantity, name: str, unit: str) -> str:
    """Return the unit; without one, the name if it is a unit itself ("rpm", "millis"), else SI or raw."""
    units = UNITS[quantity]
    if quantity in (Quantity.PWM, Quantity.COUNTS):
        unit = unit or (name if name in units else "")
        return "" if unit in ("counts", "count", "ticks", "lsb", "255", "8bit", "raw") else unit
    return unit or (name if name in units else next(iter(units)))


def _words(header: str) -> list[str]:
    text = re.sub(r"(?<=[a-z]{2})(?=[A-Z])", " ", header.strip().strip('"'))  # camelCase
    text = re.sub(r"/|\bper\b|\^-1|-1\b", " ", text.lower()).replace("counts per rev", "")
    return [word for word in re.split(r"[^a-z0-9%µ]+", text) if word]
