"""Recognize the columns of any motor log by their headers: quantity, unit and wheel."""

import math
import re
import unicodedata
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper_tuning.logs.column_names import (
    BY_UNIT,
    BY_UNIT_OF,
    COUNT_SPEEDS,
    DUTY_NAMES,
    NAMES,
    NO_QUANTITY,
    POSITIONS_RAD,
    QUALIFIERS,
    RPM_NAMES,
    SETPOINTS,
    SHOWN_UNITS,
    SIDES,
    UNITS,
    Quantity,
)

MAX_HEADER_LENGTH = 60
NUMBERED = re.compile(r"m\d\d?")


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A recognized column. `scale` converts it to SI units, but leaves counts as counts."""

    index: int
    header: str
    quantity: Quantity
    scale: float
    motor: str  # empty: common to all motors
    needs_encoder: bool = False  # in counts: the encoder's resolution is needed
    unit_given: bool = True  # the header names the unit
    unknown_unit: str = ""  # the text in the place of the unit; the scale is NaN then
    weak: bool = False  # only the last words of the header are known


def parse_headers(headers: tuple[str, ...]) -> list[Column]:
    """Recognize the columns of a table.

    Beside a column `y`, `r` is its set-point and no right wheel. Beside a set-point, `input` and `output` are
    those of a PID controller: measurement and drive.
    """
    columns = [column for i, text in enumerate(headers) if (column := parse_header(text, i))]
    first_words = {tuple(_words(text)[:1]) for text in headers}
    if ("y",) in first_words:
        columns = [
            replace(c, quantity=Quantity.SETPOINT, motor="") if _words(c.header)[:1] == ["r"] else c
            for c in columns
        ]
    is_pid = any(c.quantity is Quantity.SETPOINT for c in columns) and ("output",) in first_words
    return columns if not is_pid else list(_pid_columns(headers, columns))


def _pid_columns(headers: tuple[str, ...], columns: list[Column]) -> Iterator[Column]:
    yield from (c for c in columns if _words(c.header)[:1] != ["input"])
    for i, text in enumerate(headers):
        name, *unit = _words(text) or [""]
        if name == "input" and unit:
            found = (_with_unit(text, i, quantity, name, " ".join(unit), "") for quantity in BY_UNIT_OF[:2])
            yield from (c for c in found if c is not None and not c.unknown_unit)
        elif name == "output" and not unit:
            yield Column(index=i, header=text, quantity=Quantity.PWM, scale=1.0, motor="", unit_given=False)


def parse_header(header: str, index: int) -> Column | None:
    """Recognize a header such as `left_speed_rad_s`, `Voltage (V)` or `u [mV]`; None if unknown."""
    words, motor = _words(header), motor_of(header)
    words = [word for word in words if not _is_side(word)] if motor and len(words) > 1 else words
    if NO_QUANTITY & set(words):
        return None
    if SETPOINTS & set(words):
        return Column(index=index, header=header, quantity=Quantity.SETPOINT, scale=1.0, motor=motor)
    found = _named(header, index, words, motor)
    if found is not None and not found.unknown_unit:
        return found
    for dropped in (QUALIFIERS, QUALIFIERS | {"current"}):  # "current" is also a quantity
        rest = [word for word in words if word not in dropped]
        if rest and (other := _named(header, index, rest, motor)) and not other.unknown_unit:
            return other
    words = [word for word in words if word not in QUALIFIERS]
    for first in range(1, len(words)):
        if (other := _named(header, index, words[first:], motor)) and not other.unknown_unit:
            return replace(other, weak=True)
    return found


def is_known(header: str) -> bool:
    """Return whether a whole header is recognized, not only its last words."""
    column = parse_header(header, 0)
    return column is not None and not column.weak


def motor_of(header: str) -> str:
    """Return the name of the motor that a header names, as "left" for `l_pwm`; empty: none."""
    return next((SIDES.get(word, word) for word in _words(header) if _is_side(word)), "")


def _is_side(word: str) -> bool:
    return word in SIDES or bool(NUMBERED.fullmatch(word))


def _named(header: str, index: int, words: list[str], motor: str) -> Column | None:
    for cut in range(len(words), 0, -1):
        name, unit = " ".join(words[:cut]), " ".join(words[cut:])
        if name in BY_UNIT and unit:
            columns = (_with_unit(header, index, quantity, name, unit, motor) for quantity in BY_UNIT_OF)
            if known := next((c for c in columns if c is not None and not c.unknown_unit), None):
                return known
        for quantity, names in NAMES.items():
            if name in names and (column := _with_unit(header, index, quantity, name, unit, motor)):
                return column
    return None


def as_column(header: str, index: int, quantity: Quantity, unit: str) -> Column | None:
    """Return the column as the given quantity; with an empty unit, that of the header or the default."""
    words = [word for word in _words(header) if word not in QUALIFIERS and not _is_side(word)]
    name = NAMES[quantity][0]
    if unit:
        return _with_unit(header, index, quantity, name, " ".join(_words(unit)), "")
    for cut in range(len(words)):
        found = _with_unit(header, index, quantity, name, " ".join(words[cut:]), "")
        if found is not None and not found.unknown_unit:
            return found
    return _with_unit(header, index, quantity, name, "", "")


def _with_unit(
    header: str, index: int, quantity: Quantity, name: str, unit: str, motor: str
) -> Column | None:
    column = partial(Column, index=index, header=header, motor=motor)
    if special := _special_column(column, quantity, unit):
        return special
    if quantity is Quantity.COUNTS_PER_ROW:
        return None
    units, written = UNITS[quantity], unit
    unit = _unit_or_default(quantity, name, unit)
    if unit not in units:
        if not header.isprintable() or len(header) > MAX_HEADER_LENGTH:
            return None
        return column(quantity=quantity, scale=math.nan, unknown_unit=unit)
    if quantity is Quantity.COUNTS and unit in POSITIONS_RAD:
        return column(quantity=quantity, scale=POSITIONS_RAD[unit] / math.tau)
    given = bool(written) or (name in units and name not in DUTY_NAMES)
    return column(
        quantity=quantity,
        scale=units[unit],
        needs_encoder=quantity is Quantity.COUNTS,
        unit_given=given,
    )


def unit_error(column: Column, role: str, quantities: Iterable[Quantity]) -> ThumperError:
    """Return the error for the column of a role, which may hold `quantities`, whose unit is unknown."""
    known = ", ".join(unit for quantity in quantities for unit in SHOWN_UNITS.get(quantity, ()))
    return ThumperError(
        f"column {column.header!r}: unknown unit {column.unknown_unit!r}; pass --column "
        f"{role}={column.header}:UNIT with one of: {known}",
        exit_code=EXIT_USAGE,
    )


def _special_column(column: "partial[Column]", quantity: Quantity, unit: str) -> Column | None:
    """Recognize units that change the quantity: counts per second, counts per row, PWM in volts."""
    if quantity is Quantity.COUNTS_PER_ROW and not unit:
        return column(quantity=quantity, scale=1.0)
    if quantity is Quantity.COUNTS and unit in ("s", "sec"):
        return column(quantity=Quantity.SPEED, scale=1.0, needs_encoder=True)
    if quantity is Quantity.COUNTS and unit in ("delta", "diff", "per row", "per interval", "per period"):
        return column(quantity=Quantity.COUNTS_PER_ROW, scale=1.0)
    if quantity is Quantity.PWM and unit in UNITS[Quantity.VOLTAGE]:  # "u [V]", "command_V"
        return column(quantity=Quantity.VOLTAGE, scale=UNITS[Quantity.VOLTAGE][unit])
    if quantity is Quantity.SPEED and unit in COUNT_SPEEDS:
        return column(quantity=quantity, scale=1.0, needs_encoder=True)
    return None


def _unit_or_default(quantity: Quantity, name: str, unit: str) -> str:
    """Return the unit; without one, the name if it is a unit itself ("rpm", "millis"), else SI or raw."""
    units = UNITS[quantity]
    if quantity in (Quantity.PWM, Quantity.COUNTS):
        unit = unit or (name if name in units else "duty" if name in DUTY_NAMES else "")
        return "" if unit in ("counts", "count", "ticks", "lsb", "255", "8bit", "raw") else unit
    if quantity is Quantity.SPEED and name in RPM_NAMES:
        return unit or "rpm"
    return unit or (name if name in units else next(iter(units)))


LETTERS = str.maketrans(  # NFKD leaves these
    {"µ": "u", "μ": "u", "ß": "ss", "ł": "l", "Ł": "L", "°": "deg", "ω": "omega", "θ": "theta", "φ": "phi"}
)


def _words(header: str) -> list[str]:
    plain = unicodedata.normalize("NFKD", header.translate(LETTERS))
    text = "".join(letter for letter in plain if not unicodedata.combining(letter)).strip().strip('"')
    text = re.sub(r"(?<=[a-z]{2})(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", text)  # camelCase
    text = text.lower().replace("_", " ").replace("counts per rev", "").removeprefix("field.")  # rostopic
    text = re.sub(r"/|\bper\b|\^-1|-1\b", " ", text)
    text = re.sub(r"\b(?:motor|mot|wheel)[ #-]*([0-9])\b", r" m\1 ", text)  # "Motor 1 PWM"
    text = re.sub(r"\b([a-z]{3,})([0-9])\b", r"\1 m\2", text)  # "pwm1"
    return [word for word in re.split(r"[^a-z0-9%]+", text) if word]
