"""Read a file into one log per motor: warn about what was repaired, reject what is ambiguous."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray
from thumper_tuning.logs.column_names import Quantity
from thumper_tuning.logs.columns import Column
from thumper_tuning.logs.drive_timing import WARNING as DRIVE_SHIFTED
from thumper_tuning.logs.drive_timing import acts_before_its_row, shifted
from thumper_tuning.logs.encoder_counts import find_resets, look_like_counts_per_row, unwrap, unwrap_turns
from thumper_tuning.logs.guess_units import with_guessed_units
from thumper_tuning.logs.matlab import read_matlab
from thumper_tuning.logs.mcap_table import read_mcap_table
from thumper_tuning.logs.motor_log import BoolArray, DriveUnit, MotorLog, median_period_s
from thumper_tuning.logs.preview import preview
from thumper_tuning.logs.roles import Choices, MotorColumns, motor_columns
from thumper_tuning.logs.sampling import IntArray, sort_rows
from thumper_tuning.logs.sysid_json import read_sysid
from thumper_tuning.logs.table import LogTable, read_table
from thumper_tuning.logs.units import check_drive, check_speed, check_time, log_error

DEFAULT_COUNTS_PER_REV = 1200.0
MIN_ROWS = 20
MIN_SHARE_OF_DRIVES = 0.5  # of the rows with an output; with fewer, other rows hold the drive


def read_runs(
    files: list[Path], counts_per_rev: float, choices: Choices | None = None
) -> list[list[MotorLog]]:
    """Read several files, each a run of the same motors; return the logs of each motor."""
    per_file = [read_logs(file, counts_per_rev=counts_per_rev, choices=choices) for file in files]
    if len({len(logs) for logs in per_file}) > 1:
        raise log_error("the files do not hold the same motors; fit them one by one")
    return [list(logs) for logs in zip(*per_file, strict=True)]


def read_logs(
    path: Path,
    *,
    counts_per_rev: float = DEFAULT_COUNTS_PER_REV,
    choices: Choices | None = None,
) -> list[MotorLog]:
    """Read a CSV, SysId JSON, MATLAB or MCAP file.

    Raises
    ------
    ThumperError
        The file holds no motor log, or its units cannot be right; the message says what to change.
    """
    try:
        return _read_logs(path, counts_per_rev, choices or {})
    except ThumperError as error:
        if str(path) in str(error):
            raise
        raise ThumperError(f"{path}: {error}", exit_code=error.exit_code) from error


def _read_logs(path: Path, counts_per_rev: float, choices: Choices) -> list[MotorLog]:
    suffix = path.suffix.lower()
    if suffix == ".json":
        return read_sysid(path)
    if suffix == ".mat":
        table = read_matlab(path)
    elif suffix == ".mcap":
        table = read_mcap_table(path)
    else:
        table = read_table(path)
    motors = motor_columns(path, table.headers, choices)
    return [_motor_log(path, table, name, columns, counts_per_rev) for name, columns in motors.items()]


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
        return median_period_s(self.time_s, self.starts_segment, np.isfinite(self.output))


def _motor_log(
    path: Path, table: LogTable, motor: str, columns: MotorColumns, counts_per_rev: float
) -> MotorLog:
    columns, guesses = with_guessed_units(columns, table.values)
    values = {column: table.values[:, column.index] * column.scale for _, column in columns.used}
    output_values = values[columns.output]
    values[columns.output] = np.where(np.isfinite(output_values), output_values, np.nan)
    if columns.setpoint is not None and not np.nan_to_num(values[columns.setpoint]).any():
        columns = replace(columns, setpoint=None)  # 0 in every row: nothing controlled the speed
    rows = _usable_rows(path, columns, values)
    if columns.direction is not None:
        _apply_direction(rows, columns, values[columns.direction][rows.rows])
    drive_note = table.drive_notes.get(columns.drive.header)
    rows.warnings[:0] = [*table.notes, *([drive_note] if drive_note else []), *guesses]
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
        counts = _continuous_counts(rows, counts_per_rev if columns.output.needs_encoder else 1.0)
        position = counts * (quantum_rad if columns.output.needs_encoder else 2.0 * np.pi)
    motion = speed if position is None else np.diff(position, prepend=position[0])
    if motion is not None and acts_before_its_row(rows.drive, motion, rows.starts_segment):
        rows.drive = shifted(rows.drive, rows.starts_segment)
        rows.warnings.append(DRIVE_SHIFTED)
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
        has_setpoint=columns.setpoint is not None,
        columns=tuple(preview(table.headers, columns, values)),
        warnings=tuple(rows.warnings),
    )


def _apply_direction(rows: _Rows, columns: MotorColumns, direction: FloatArray) -> None:
    """Give the drive, and a speed without a sign, the sign that a column of directions says.

    The column holds -1 and 1, or two other numbers of which the larger one is forward.
    """
    low, high = float(np.nanmin(direction, initial=np.inf)), float(np.nanmax(direction, initial=-np.inf))
    if not low < high or (rows.drive < 0.0).any():
        return
    sign = np.sign(direction) if low < 0.0 else np.where(direction > 0.5 * (low + high), 1.0, -1.0)
    rows.drive = rows.drive * np.where(np.isfinite(sign), sign, 0.0)
    signed = columns.drive.header
    if columns.output.quantity is Quantity.SPEED and not (rows.output < 0.0).any():
        rows.output = rows.output * np.where(np.isfinite(sign), sign, 1.0)
        signed += f" and {columns.output.header}"
    assert columns.direction is not None
    rows.warnings.append(f"{signed}: the sign is that of column {columns.direction.header!r}")


def _usable_rows(path: Path, columns: MotorColumns, values: dict[Column, FloatArray]) -> _Rows:
    """Drop rows without time or drive, and sort the others by time."""
    time_s, drive = values[columns.time], values[columns.drive]
    measured = np.isfinite(values[columns.output])
    warnings: list[str] = []
    if measured.any() and np.isfinite(drive[measured]).mean() < MIN_SHARE_OF_DRIVES:
        drive = _held(drive)
        warnings.append("drive and output are in different rows: each drive holds until the next one")
    usable = np.isfinite(time_s) & np.isfinite(drive)
    if (lost := int(len(usable) - usable.sum())) > 0:
        warnings.append(f"{lost} rows without time or drive: dropped")
    if usable.sum() < MIN_ROWS:
        raise log_error(
            f"{path}: {int(usable.sum())} usable rows are too few; record at least 10 s at 10 Hz or faster"
        )
    rows = np.flatnonzero(usable)
    check_time(time_s[rows], columns.time.header)
    order, starts_segment, sorting = sort_rows(time_s[rows], measured[rows])
    rows = rows[order]
    return _Rows(
        rows=rows,
        time_s=time_s[rows],
        drive=drive[rows],
        output=values[columns.output][rows],
        starts_segment=starts_segment,
        warnings=warnings + sorting,
    )


def _held(drive: FloatArray) -> FloatArray:
    """Return the drive of the last row that has one; NaN before the first."""
    last = np.maximum.accumulate(np.where(np.isfinite(drive), np.arange(len(drive)), -1))
    return np.where(last >= 0, drive[last], np.nan)


def _refer_drive_to_mean_supply(
    rows: _Rows, columns: MotorColumns, values: dict[Column, FloatArray]
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
    found = f"column {output.header!r} follows the drive like a speed"
    if not output.needs_encoder:
        raise log_error(f"{found}, not like a position; pass its unit: --column output={output.header}:UNIT")
    other = "" if output.unit_given else f"; else pass --column output={output.header}:UNIT"
    rows.warnings.append(f"{found}: read as counts since the last row{other}")
    return True


def _continuous_counts(rows: _Rows, per_turn: float) -> FloatArray:
    """Undo the wraps of a counter or an angle, and start a new segment at each reset."""
    turns, wraps = unwrap_turns(rows.output / per_turn)
    counts, bits = (turns * per_turn, 0) if wraps else unwrap(rows.output)
    if wraps:
        rows.warnings.append("the angle wraps each turn: unwrapped")
    if bits:
        rows.warnings.append(f"the counter wraps at {bits} bits: unwrapped")
    resets = find_resets(counts)
    rows.starts_segment[resets] = True
    if len(resets):
        rows.warnings.append(f"the counter was reset {len(resets)} times: the log is split there")
    return counts
