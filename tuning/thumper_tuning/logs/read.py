"""Read a file into one log per motor: warn about what was repaired, reject what is ambiguous."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.logs.columns import Column, Quantity
from thumper_tuning.logs.encoder_counts import find_resets, look_like_counts_per_row, unwrap
from thumper_tuning.logs.motor_log import BoolArray, DriveUnit, MotorLog
from thumper_tuning.logs.sampling import IntArray, sort_rows
from thumper_tuning.logs.sysid_json import read_sysid
from thumper_tuning.logs.table import Table, read_table
from thumper_tuning.logs.units import check_drive, check_speed, check_time, log_error

DEFAULT_COUNTS_PER_REV = 1200.0
OUTPUTS = (Quantity.COUNTS, Quantity.COUNTS_PER_ROW, Quantity.SPEED)
MIN_ROWS = 20


def read_runs(files: list[Path], counts_per_rev: float) -> list[list[MotorLog]]:
    """Read several files, each a run of the same motors; return the logs of each motor."""
    per_file = [read_logs(file, counts_per_rev=counts_per_rev) for file in files]
    if len({len(logs) for logs in per_file}) > 1:
        raise log_error("the files do not hold the same motors; fit them one by one")
    return [list(logs) for logs in zip(*per_file, strict=True)]


def read_logs(path: Path, *, counts_per_rev: float = DEFAULT_COUNTS_PER_REV) -> list[MotorLog]:
    """Read a CSV file or a SysId JSON file.

    Raises
    ------
    ThumperError
        The file holds no motor log, or its units cannot be right; the message says what to change.
    """
    if path.suffix.lower() == ".json":
        return read_sysid(path)
    table = read_table(path)
    motors = sorted({c.motor for c in table.columns if c.quantity in OUTPUTS})
    if len(motors) > 1 and "" in motors:
        motors.remove("")
    if not motors:
        raise log_error(
            f"{path}: no column holds counts or speed (columns: {', '.join(table.headers)}); "
            "name one counts or speed_rad_s"
        )
    return [_motor_log(path, table, motor, counts_per_rev) for motor in motors]


@dataclass(frozen=True, slots=True, kw_only=True)
class _MotorColumns:
    """The columns of one motor."""

    time: Column
    drive: Column
    output: Column
    battery: Column | None
    current: Column | None

    @property
    def drive_unit(self) -> DriveUnit:
        return DriveUnit.VOLT if self.drive.quantity is Quantity.VOLTAGE else DriveUnit.PWM


@dataclass(slots=True, kw_only=True, eq=False)
class _Rows:
    """The usable rows of one motor in time order, shape (n,) each; warnings collect what was repaired."""

    rows: IntArray  # of the file
    time_s: FloatArray
    drive: FloatArray
    output: FloatArray
    starts_segment: BoolArray
    warnings: list[str]

    @property
    def period_s(self) -> float:
        return float(np.median(np.diff(self.time_s)[~self.starts_segment[1:]]))


def _motor_log(path: Path, table: Table, motor: str, counts_per_rev: float) -> MotorLog:
    columns = _motor_columns(path, table, motor)
    values = {column: table.values[:, j] * column.scale for j, column in enumerate(table.columns)}
    rows = _usable_rows(path, columns, values)
    if warning := check_drive(rows.drive, columns.drive_unit, columns.drive.header):
        rows.warnings.append(warning)
    supply_V = _refer_drive_to_mean_supply(rows, columns, values)
    position: FloatArray | None = None
    speed: FloatArray | None = None
    quantum_rad = 2.0 * np.pi / counts_per_rev if columns.output.needs_encoder else 0.0
    if columns.output.quantity is Quantity.SPEED:
        speed = rows.output * quantum_rad if columns.output.needs_encoder else rows.output
        check_speed(speed, rows.period_s, counts_per_rev, columns.output.header)
    elif _has_counts_per_row(rows, columns.output):
        counts = np.where(np.isfinite(rows.output), rows.output, 0.0)
        position = np.cumsum(counts) * 2.0 * np.pi / counts_per_rev
        quantum_rad = 2.0 * np.pi / counts_per_rev
    else:
        counts = _continuous_counts(rows)
        position = counts * (quantum_rad if columns.output.needs_encoder else 2.0 * np.pi)
    return MotorLog(
        name=motor or path.stem,
        drive_unit=columns.drive_unit,
        time_s=rows.time_s,
        drive=rows.drive,
        starts_segment=rows.starts_segment,
        position_rad=position,
        speed_rad_s=speed,
        quantum_rad=quantum_rad,
        current_A=values[columns.current][rows.rows] if columns.current else None,
        supply_V=supply_V,
        warnings=tuple(rows.warnings),
    )


def _motor_columns(path: Path, table: Table, motor: str) -> _MotorColumns:
    def required(names: str, *quantities: Quantity) -> Column:
        column = _find(table, motor, *quantities)
        if column is None:
            wheel = f" for the motor {motor!r}" if motor else ""
            raise log_error(
                f"{path}: no column {names}{wheel} (columns: {', '.join(table.headers)}); name one so"
            )
        return column

    return _MotorColumns(
        time=required("time_s", Quantity.TIME),
        drive=required("pwm or voltage_V", Quantity.PWM, Quantity.VOLTAGE),
        output=required("counts or speed_rad_s", *OUTPUTS),
        battery=_find(table, motor, Quantity.BATTERY),
        current=_find(table, motor, Quantity.CURRENT),
    )


def _find(table: Table, motor: str, *quantities: Quantity) -> Column | None:
    """Find a column, the motor's own before a common one, in the order of `quantities`."""
    for owner in dict.fromkeys((motor, "")):
        for quantity in quantities:
            for column in table.columns:
                if column.quantity is quantity and column.motor == owner:
                    return column
    return None


def _usable_rows(path: Path, columns: _MotorColumns, values: dict[Column, FloatArray]) -> _Rows:
    """Drop rows without time or drive, and sort the others by time."""
    time_s, drive = values[columns.time], values[columns.drive]
    usable = np.isfinite(time_s) & np.isfinite(drive)
    warnings: list[str] = []
    if (lost := int(len(usable) - usable.sum())) > 0:
        warnings.append(f"{lost} rows without time or drive: dropped")
    if usable.sum() < MIN_ROWS:
        raise log_error(
            f"{path}: {int(usable.sum())} usable rows are too few; record at least 10 s at 10 Hz or faster"
        )
    rows = np.flatnonzero(usable)
    check_time(time_s[rows], columns.time.header)
    order, starts_segment, sorting = sort_rows(time_s[rows])
    rows = rows[order]
    return _Rows(
        rows=rows,
        time_s=time_s[rows],
        drive=drive[rows],
        output=values[columns.output][rows],
        starts_segment=starts_segment,
        warnings=warnings + sorting,
    )


def _refer_drive_to_mean_supply(
    rows: _Rows, columns: _MotorColumns, values: dict[Column, FloatArray]
) -> float | None:
    """Scale the PWM as if the battery had always had its mean voltage, and return that voltage.

    The motor responds to PWM times voltage, so a falling battery would look like a falling gain.
    """
    if columns.battery is None or columns.drive_unit is not DriveUnit.PWM:
        return None
    supply_V = values[columns.battery][rows.rows]
    good = np.isfinite(supply_V) & (supply_V > 1.0)
    if good.mean() < 0.5:
        return None
    mean_V = float(np.mean(supply_V[good]))
    filled_V = np.interp(np.arange(len(supply_V)), np.flatnonzero(good), supply_V[good])
    rows.drive = rows.drive * filled_V / mean_V
    return mean_V


def _has_counts_per_row(rows: _Rows, output: Column) -> bool:
    if output.quantity is Quantity.COUNTS_PER_ROW:
        return True
    if not look_like_counts_per_row(rows.output, rows.drive):
        return False
    rows.warnings.append(
        f"column {output.header!r} follows the drive like a speed: read as counts since the last row"
    )
    return True


def _continuous_counts(rows: _Rows) -> FloatArray:
    """Undo counter wraps, and start a new segment at each reset."""
    counts, bits = unwrap(rows.output)
    if bits:
        rows.warnings.append(f"the counter wraps at {bits} bits: unwrapped")
    resets = find_resets(counts)
    rows.starts_segment[resets] = True
    if len(resets):
        rows.warnings.append(f"the counter was reset {len(resets)} times: the log is split there")
    return counts
