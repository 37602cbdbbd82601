"""Choose the columns of each motor: by their headers, or as the user says with `--column`."""

from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper_tuning.logs.column_names import Quantity
from thumper_tuning.logs.columns import (
    Column,
    as_column,
    motor_of,
    parse_header,
    parse_headers,
    unit_error,
)
from thumper_tuning.logs.motor_log import DriveUnit
from thumper_tuning.logs.units import log_error

DATES = ("date", "datum", "fecha", "data")
MEASUREMENTS = ("input", "measured", "measurement")  # of a controller; only the user knows the unit
OUTPUTS = (Quantity.COUNTS, Quantity.COUNTS_PER_ROW, Quantity.SPEED)


class Role(Enum):
    """What a column is used for, with the quantities that it may hold."""

    TIME = (Quantity.TIME,)
    DRIVE = (Quantity.PWM, Quantity.VOLTAGE)
    OUTPUT = OUTPUTS
    BATTERY = (Quantity.BATTERY,)
    CURRENT = (Quantity.CURRENT,)
    SETPOINT = (Quantity.SETPOINT,)
    DIRECTION = (Quantity.DIRECTION,)


ROLE_NAMES = ", ".join(role.name.lower() for role in Role)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorColumns:
    """The columns of one motor."""

    time: Column
    drive: Column
    output: Column
    battery: Column | None
    current: Column | None
    setpoint: Column | None
    direction: Column | None

    @property
    def drive_unit(self) -> DriveUnit:
        """Unit of the drive."""
        return DriveUnit.VOLT if self.drive.quantity is Quantity.VOLTAGE else DriveUnit.PWM

    @property
    def used(self) -> list[tuple[str, Column]]:
        """Role and column, of those that are used."""
        roles = [(role.name.lower(), getattr(self, role.name.lower())) for role in Role]
        return [(name, column) for name, column in roles if column is not None]


Choices = dict[Role, tuple[str, ...]]
"""The columns that the user chose for a role, as `HEADER` or `HEADER:UNIT`; several for several motors."""


def parse_choices(texts: list[str] | None) -> Choices:
    """Read `ROLE=HEADER` or `ROLE=HEADER:UNIT`, as `drive=MotorPWM` or `time=1:ms`.

    Raises
    ------
    ThumperError
        A text has another form, or an unknown role.
    """
    found: Choices = {}
    for text in texts or []:
        name, equals, header = text.partition("=")
        if not equals or name.strip().upper() not in Role.__members__ or not header.strip():
            raise ThumperError(
                f"--column {text!r}: pass ROLE=HEADER or ROLE=HEADER:UNIT with a role of {ROLE_NAMES}",
                exit_code=EXIT_USAGE,
            )
        role = Role[name.strip().upper()]
        found[role] = (*found.get(role, ()), header.strip())
    return found


def motor_columns(path: Path, headers: tuple[str, ...], choices: Choices) -> dict[str, MotorColumns]:
    """Return the columns of each motor in the table, by the motor's name (empty: the only one).

    Raises
    ------
    ThumperError
        A needed column is missing, or its unit is unknown.
    """
    columns = parse_headers(headers)
    picked = {role: [_picked(path, headers, role, text) for text in texts] for role, texts in choices.items()}
    if len(picked.get(Role.OUTPUT, ())) == 1:
        motors = [""]
    else:
        known = [c for c in columns if c.quantity in OUTPUTS]
        outputs = picked.get(Role.OUTPUT) or [c for c in known if not c.weak] or known
        motors = sorted({c.motor for c in outputs})
        if len(motors) > 1 and "" in motors:
            motors.remove("")
    names = ", ".join(headers)
    if not motors:
        raise log_error(
            f"{path}: no column holds counts or speed (columns: {names}); name one counts or speed_rad_s, "
            f"or pass --column output={_measurement(headers, columns)}:UNIT"
        )

    def find(motor: str, role: Role) -> Column | None:
        chosen = picked.get(role, [])
        for column in chosen:
            if len(motors) == 1 or column.motor in (motor, ""):
                return column
        return _best(columns, motor, role)

    def required(motor: str, role: Role, example: str) -> Column:
        column = find(motor, role)
        if column is None:
            wheel = f" for the motor {motor!r}" if motor else ""
            raise log_error(
                f"{path}: no column {example}{wheel} (columns: {names}); name one so, or pass --column "
                f"{role.name.lower()}=HEADER"
            )
        if column.unknown_unit:
            raise unit_error(column, role.name.lower(), role.value)
        return column

    return {
        motor: MotorColumns(
            time=required(motor, Role.TIME, "time_s"),
            drive=required(motor, Role.DRIVE, "pwm or voltage_V"),
            output=required(motor, Role.OUTPUT, "counts or speed_rad_s"),
            battery=find(motor, Role.BATTERY),
            current=find(motor, Role.CURRENT),
            setpoint=find(motor, Role.SETPOINT),
            direction=find(motor, Role.DIRECTION),
        )
        for motor in motors
    }


def _measurement(headers: tuple[str, ...], columns: list[Column]) -> str:
    """Return the header beside a set-point that must be the measurement, or the word HEADER."""
    claimed = {column.index for column in columns}
    found = [
        header
        for i, header in enumerate(headers)
        if i not in claimed and header.strip().lower() in MEASUREMENTS
    ]
    is_controlled = any(column.quantity is Quantity.SETPOINT for column in columns)
    return found[0] if is_controlled and len(found) == 1 else "HEADER"


def _best(columns: list[Column], motor: str, role: Role) -> Column | None:
    """Find a column: of a known unit first, the motor's own before a common one, in the order of the role."""
    found = [
        (
            bool(column.unknown_unit),
            column.weak,
            column.motor != motor,
            role.value.index(column.quantity),
            column.header.strip().lower() in DATES,  # beside a column with the time of day
            column.index,
        )
        for column in columns
        if column.quantity in role.value and column.motor in (motor, "")
    ]
    best = min(found, default=None)
    if best is None or ((best[0] or best[1]) and role not in (Role.TIME, Role.DRIVE, Role.OUTPUT)):
        return None
    return next(column for column in columns if column.index == best[-1])


def _picked(path: Path, headers: tuple[str, ...], role: Role, text: str) -> Column:
    """Return the column that the user names: by its header, without regard to case, or by its number."""
    name, unit = text, ""
    if _index(headers, name) is None and ":" in text:
        name, _, unit = text.rpartition(":")
    index = _index(headers, name)
    if index is None:
        raise ThumperError(
            f"{path}: no column {name!r} (columns: {', '.join(headers)}); pass a header or a number from 1",
            exit_code=EXIT_USAGE,
        )
    header = headers[index]
    own = parse_header(header, index)
    if own is not None and own.quantity in role.value and not unit:
        return own
    quantities = list(role.value)
    if own is not None and own.quantity in role.value:  # first; a given unit may say that it is another
        quantities = [own.quantity, *[q for q in role.value if q is not own.quantity and unit]]
    motor = motor_of(header)
    candidates = [c for q in quantities if (c := as_column(header, index, q, unit)) is not None]
    fitting = [c for c in candidates if not c.unknown_unit]
    if fitting:
        return replace(fitting[0], motor=motor)
    if candidates:
        raise unit_error(candidates[0], role.name.lower(), role.value)
    raise log_error(f"{path}: column {header!r}: unknown unit")


def _index(headers: tuple[str, ...], name: str) -> int | None:
    matches = [i for i, header in enumerate(headers) if header.strip().lower() == name.strip().lower()]
    if matches:
        return matches[0]
    number = int(name) - 1 if name.strip().isdigit() else -1
    return number if 0 <= number < len(headers) else None
