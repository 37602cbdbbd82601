"""Read a file into one log per motor; say what was mended, refuse what cannot be meant."""

from pathlib import Path

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.logs.columns import Column, Quantity
from thumper_tuning.logs.encoder_counts import look_like_counts_per_row, resets, unwrap
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog
from thumper_tuning.logs.sampling import order_rows
from thumper_tuning.logs.sysid_json import read_sysid
from thumper_tuning.logs.table import Table, read_table
from thumper_tuning.logs.units import check_drive, check_speed, check_time, refusal

DEFAULT_COUNTS_PER_REV = 1200.0
POSITIONS = (Quantity.COUNTS, Quantity.COUNTS_PER_ROW, Quantity.SPEED)
FEWEST_ROWS = 20


def read_logs(path: Path, *, counts_per_rev: float = DEFAULT_COUNTS_PER_REV) -> list[MotorLog]:
    """Read a CSV file or a SysId JSON file.

    Raises
    ------
    ThumperError
        The file holds no motor log, or one whose units cannot be right; the message says what to change.
    """
    if path.suffix.lower() == ".json":
        return read_sysid(path)
    table = read_table(path)
    motors = sorted({c.motor for c in table.columns if c.quantity in POSITIONS})
    if len(motors) > 1 and "" in motors:
        motors.remove("")
    if not motors:
        raise refusal(
            f"{path}: no column holds counts or speed (there are: {', '.join(table.headers)}); "
            "name one counts or speed_rad_s"
        )
    return [_motor(path, table, motor, counts_per_rev) for motor in motors]


def _motor(path: Path, table: Table, motor: str, counts_per_rev: float) -> MotorLog:
    time = _find(table, motor, (Quantity.TIME,))
    drive = _find(table, motor, (Quantity.PWM, Quantity.VOLTAGE))
    output = _find(table, motor, POSITIONS)
    for column, names in ((time, "time_s"), (drive, "pwm or voltage_V"), (output, "counts or speed_rad_s")):
        if column is None:
            wheel = f" for the motor {motor!r}" if motor else ""
            raise refusal(
                f"{path}: no column {names}{wheel} (there are: {', '.join(table.headers)}); name it so"
            )
    assert time is not None
    assert drive is not None
    assert output is not None
    warnings: list[str] = []
    values = {column: table.values[:, j] * column.scale for j, column in enumerate(table.columns)}
    usable = np.isfinite(values[time]) & np.isfinite(values[drive])
    if (lost := int(len(usable) - usable.sum())) > 0:
        warnings.append(f"{lost} rows without time or drive left out")
    if usable.sum() < FEWEST_ROWS:
        raise refusal(
            f"{path}: {int(usable.sum())} usable rows are too few; record at least 10 s at 10 Hz or faster"
        )
    rows = np.flatnonzero(usable)
    check_time(values[time][rows], time.header)
    order, begins, notes = order_rows(values[time][rows])
    warnings += notes
    rows = rows[order]
    time_s, u, y = values[time][rows], values[drive][rows], values[output][rows]
    unit = DriveUnit.VOLT if drive.quantity is Quantity.VOLTAGE else DriveUnit.PWM
    if note := check_drive(u, unit, drive.header):
        warnings.append(note)
    u, supply_V = _at_mean_supply(table, motor, values, rows, u, unit)
    period_s = float(np.median(np.diff(time_s)[~begins[1:]]))
    current = _find(table, motor, (Quantity.CURRENT,))
    position: FloatArray | None = None
    speed: FloatArray | None = None
    quantum_rad = 2.0 * np.pi / counts_per_rev if output.needs_encoder else 0.0
    if output.quantity is Quantity.SPEED:
        speed = y * quantum_rad if output.needs_encoder else y
        check_speed(speed, period_s, counts_per_rev, output.header)
    else:
        per_row = output.quantity is Quantity.COUNTS_PER_ROW
        if not per_row and look_like_counts_per_row(y, u):
            per_row = True
            warnings.append(
                f"column {output.header!r} follows the drive like a speed: taken as counts since the last row"
            )
        if per_row:
            position = np.cumsum(np.where(np.isfinite(y), y, 0.0)) * 2.0 * np.pi / counts_per_rev
            quantum_rad = 2.0 * np.pi / counts_per_rev
        else:
            y, bits = unwrap(y)
            if bits:
                warnings.append(f"the counter wraps at {bits} bits: undone")
            again = resets(y)
            begins[again] = True
            if len(again):
                warnings.append(f"the counter was reset {len(again)} times: the log is cut there")
            position = y * (quantum_rad if output.needs_encoder else 2.0 * np.pi)
    return MotorLog(
        name=motor or path.stem,
        drive_unit=unit,
        time_s=time_s,
        drive=u,
        begins=begins,
        position_rad=position,
        speed_rad_s=speed,
        quantum_rad=quantum_rad,
        current_A=values[current][rows] if current else None,
        supply_V=supply_V,
        warnings=tuple(warnings),
    )


def _find(table: Table, motor: str, quantities: tuple[Quantity, ...]) -> Column | None:
    """The motor's own column before a common one; counts before speeds."""
    for owner in dict.fromkeys((motor, "")):
        for quantity in quantities:
            for column in table.columns:
                if column.quantity is quantity and column.motor == owner:
                    return column
    return None


def _at_mean_supply(
    table: Table,
    motor: str,
    values: dict[Column, FloatArray],
    rows: np.ndarray[tuple[int], np.dtype[np.intp]],
    drive: FloatArray,
    unit: DriveUnit,
) -> tuple[FloatArray, float | None]:
    """PWM as if the battery had always had its mean voltage: the motor feels PWM times voltage."""
    battery = _find(table, motor, (Quantity.BATTERY,))
    if battery is None or unit is not DriveUnit.PWM:
        return drive, None
    supply_V = values[battery][rows]
    good = np.isfinite(supply_V) & (supply_V > 1.0)
    if good.mean() < 0.5:
        return drive, None
    mean_V = float(np.mean(supply_V[good]))
    filled_V = np.interp(np.arange(len(supply_V)), np.flatnonzero(good), supply_V[good])
    return drive * filled_V / mean_V, mean_V
