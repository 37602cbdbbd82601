"""Recognize the columns of any motor log by their headers: quantity, unit and wheel."""

import math
import re
import unicodedata
from dataclasses import dataclass, replace
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
    SETPOINT = "setpoint"
    DIRECTION = "direction"


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


# Names are matched as whole words, longest first, after the wheel is removed. The other words are the unit.
# English, German, Spanish, Portuguese, French, Italian, Dutch, Czech and Polish, without accents.
NAMES = {
    Quantity.TIME: (
        "time", "t", "timestamp", "time stamp", "stamp", "zeit", "tijd", "tiempo", "tempo", "temps",
        "elapsed", "elapsed time", "clock", "millis", "micros", "cas", "czas",
        "date", "datetime", "date time", "ms", "us", "sec", "seconds",
    ),
    Quantity.PWM: (
        "pwm", "duty", "dutycycle", "duty cycle", "u", "command", "cmd", "drive", "input", "throttle",
        "effort", "stellgrosse",
    ),
    Quantity.VOLTAGE: (
        "voltage", "volt", "volts", "v", "uin", "vin", "vm", "motor voltage", "input voltage", "voltaje",
        "tension", "tensao", "tensione", "spannung", "napeti", "napiecie", "mv",
    ),
    Quantity.COUNTS: (
        "counts", "count", "ticks", "tick", "encoder", "enc", "position", "pos", "steps", "pulses", "angle",
        "theta", "phi", "posicion", "pulsos", "cuentas", "winkel", "angulo",
    ),
    Quantity.COUNTS_PER_ROW: (
        "delta counts", "counts delta", "counts per row", "dcounts", "delta ticks", "dticks",
    ),
    Quantity.SPEED: (
        "speed", "velocity", "omega", "vel", "w", "rate", "rpm", "angular velocity", "angular speed",
        "wheel speed", "velocidad", "velocidad angular", "velocidade", "vitesse", "velocita",
        "geschwindigkeit", "drehzahl", "snelheid", "toerental", "rychlost", "otacky", "predkosc", "obroty",
        "rad s", "rads", "radps", "deg s", "rps", "rev s",
    ),
    Quantity.CURRENT: ("current", "i", "amps", "strom", "corriente", "corrente", "courant"),
    Quantity.BATTERY: ("battery", "vbat", "supply", "battery voltage", "vbatt", "bus voltage", "bateria"),
    Quantity.DIRECTION: ("direction", "dir", "richtung", "direccion", "direcao", "sens"),
}  # fmt: skip
BY_UNIT = frozenset(("y", "output"))  # only the unit says what they are
BY_UNIT_OF = (Quantity.SPEED, Quantity.COUNTS, Quantity.PWM, Quantity.VOLTAGE)
SETPOINTS = frozenset(
    ("setpoint", "target", "reference", "ref", "desired", "goal", "sp", "sollwert", "consigna")
)
NO_QUANTITY = frozenset(("error", "err", "kp", "ki", "kd", "integral", "proportional", "derivative"))
# Words that add nothing. They are dropped only if a header is not recognized with them.
QUALIFIERS = frozenset(
    ("motor", "wheel", "measured", "meas", "actual", "act", "real", "raw", "filtered", "filt", "value",
     "signal", "encoder", "shaft", "applied", "in", "of", "the", "dc", "data", "avg", "mean",
     "wert", "hodnota", "valor", "valeur", "wartosc")
)  # fmt: skip
UNITS: dict[Quantity, dict[str, float]] = {
    Quantity.TIME: {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "millis": 1e-3, "us": 1e-6,
                    "micros": 1e-6, "ns": 1e-9, "min": 60.0},
    Quantity.PWM: {"": 1.0, "pwm": 1.0, "%": 2.55, "percent": 2.55, "duty": 255.0, "dutycycle": 255.0},
    Quantity.VOLTAGE: {"v": 1.0, "volt": 1.0, "volts": 1.0, "mv": 1e-3},
    Quantity.COUNTS: {"": 1.0, "rad": math.nan, "deg": math.nan, "rev": math.nan},
    Quantity.SPEED: {"rad s": 1.0, "rads": 1.0, "radps": 1.0, "mrad s": 1e-3, "deg s": math.pi / 180.0,
                     "rpm": math.pi / 30.0, "rps": math.tau, "rev s": math.tau, "hz": math.tau,
                     **dict.fromkeys(("1 min", "rev min", "r min", "u min"), math.pi / 30.0),
                     **dict.fromkeys(("tr min", "ot min", "obr min"), math.pi / 30.0)},
    Quantity.CURRENT: {"a": 1.0, "ma": 1e-3},
    Quantity.BATTERY: {"v": 1.0, "mv": 1e-3},
    Quantity.DIRECTION: {"": 1.0},
}  # fmt: skip
COUNT_SPEEDS = ("steps s", "counts s", "ticks s", "count s", "cps", "pulses s")
RPM_NAMES = frozenset(("drehzahl", "toerental", "otacky", "obroty"))  # they mean turns per minute
POSITIONS_RAD = {"rad": 1.0, "deg": math.pi / 180.0, "rev": math.tau}
SIDES = ("left", "right", "l", "r", "front", "rear", "fl", "fr", "rl", "rr")
NUMBERED = re.compile(r"m[1-9]\d?")
LONG_SIDES = {"l": "left", "r": "right"}


def parse_headers(headers: tuple[str, ...]) -> list[Column]:
    """Recognize the columns of a table; beside a column `y`, `r` is its set-point and no right wheel."""
    columns = [column for i, text in enumerate(headers) if (column := parse_header(text, i))]
    if not any(_words(text)[:1] == ["y"] for text in headers):
        return columns
    return [
        replace(c, quantity=Quantity.SETPOINT, motor="") if _words(c.header)[:1] == ["r"] else c
        for c in columns
    ]


def parse_header(header: str, index: int) -> Column | None:
    """Recognize a header such as `left_speed_rad_s`, `Voltage (V)` or `u [mV]`; None if unknown."""
    words, motor = _words(header), motor_of(header)
    words = [word for word in words if not _is_side(word)] if motor and len(words) > 1 else words
    if NO_QUANTITY & set(words):
        return None
    if SETPOINTS & set(words):
        return Column(index=index, header=header, quantity=Quantity.SETPOINT, scale=1.0, motor=motor)
    found = _named(header, index, words, motor)
    if found is None or found.unknown_unit:
        for dropped in (QUALIFIERS, QUALIFIERS | {"current"}):  # "current" is also a quantity
            rest = [word for word in words if word not in dropped]
            if rest and (other := _named(header, index, rest, motor)) and not other.unknown_unit:
                return other
    return found


def motor_of(header: str) -> str:
    """Return the name of the motor that a header names, as "left" for `l_pwm`; empty: none."""
    sides = [word for word in _words(header) if _is_side(word)]
    return LONG_SIDES.get(sides[0], sides[0]) if sides else ""


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
    given = bool(written) or name in units
    return column(
        quantity=quantity,
        scale=units[unit],
        needs_encoder=quantity is Quantity.COUNTS,
        unit_given=given,
    )


def unit_error(column: Column) -> ThumperError:
    """Return the error for a needed column whose unit is unknown."""
    example = next(iter(UNITS.get(column.quantity, {"": 1.0}))).replace(" ", "_") or "raw"
    return ThumperError(
        f"column {column.header!r}: unknown unit {column.unknown_unit!r}; rename it, for example to "
        f"{column.quantity.value}_{example}, or pass its unit: --column ROLE={column.header}:UNIT",
        exit_code=EXIT_CHECK_FAILED,
    )


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
    if quantity is Quantity.SPEED and name in RPM_NAMES:
        return unit or "rpm"
    return unit or (name if name in units else next(iter(units)))


LETTERS = str.maketrans({"µ": "u", "μ": "u", "ß": "ss", "ł": "l", "Ł": "L", "°": "deg"})  # NFKD leaves these


def _words(header: str) -> list[str]:
    plain = unicodedata.normalize("NFKD", header.translate(LETTERS))
    text = "".join(letter for letter in plain if not unicodedata.combining(letter)).strip().strip('"')
    text = re.sub(r"(?<=[a-z]{2})(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", text)  # camelCase
    text = re.sub(r"/|\bper\b|\^-1|-1\b", " ", text.lower()).replace("counts per rev", "")
    text = re.sub(r"\b(?:motor|mot|wheel)[ _#-]*([1-9])\b", r" m\1 ", text)  # "Motor 1 PWM"
    text = re.sub(r"\b([a-z]{3,})([1-9])\b", r"\1 m\2", text)  # "pwm1"
    return [word for word in re.split(r"[^a-z0-9%]+", text) if word]
