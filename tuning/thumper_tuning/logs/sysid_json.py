"""Read WPILib SysId recordings: up to four tests, with voltages, positions and speeds."""

import json
import math
from pathlib import Path

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import read_text, unreadable
from thumper.common.geometry import FloatArray
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog
from thumper_tuning.logs.units import check_time

MAX_MB = 200.0
TESTS = ("slow-forward", "slow-backward", "fast-forward", "fast-backward")
SIDES = (("left", 1, 3), ("right", 2, 4))  # name, column of the voltage, column of the position
GRAVITY = "test type {test}: the model has no gravity, and takes it as friction: gain and friction are off"
UNIT_RAD = {"Rotations": math.tau, "Radians": 1.0, "Degrees": math.pi / 180.0}


def read_sysid(path: Path) -> list[MotorLog]:
    """Read a recording of any test type; `unitsPerRotation` converts metres to radians of the wheel.

    A drive train has two sides; the other types (Simple, Elevator, Arm) have one motor. Uses the positions,
    not the reported speeds: those were filtered, and the file does not say how. If the positions repeat,
    it uses the speeds, and the fit estimates the filter's window.

    Raises
    ------
    ThumperError
        The file is not a SysId recording.
    """
    try:
        data = json.loads(read_text(path, MAX_MB))
        tests = [np.array(data[name], dtype=float) for name in TESTS if data.get(name)]
        rad = UNIT_RAD.get(data["units"], 0.0)
        units_per_rotation = math.tau if rad else float(data["unitsPerRotation"])
        gravity = GRAVITY.format(test=data["test"]) if data.get("test") in ("Elevator", "Arm") else ""
    except OSError as error:
        raise unreadable(path, error) from error
    except KeyError as error:
        raise ThumperError(
            f"{path}: not a SysId recording (no key {error}); pass a CSV file", exit_code=EXIT_USAGE
        ) from error
    except (ValueError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        why = f" ({error})" if isinstance(error, json.JSONDecodeError) else ""
        raise ThumperError(
            f"{path}: not a SysId recording{why}; pass a CSV file", exit_code=EXIT_USAGE
        ) from error
    if not 0.0 < units_per_rotation < math.inf:
        raise ThumperError(
            f"{path}: unitsPerRotation is {units_per_rotation:g}; set the {data['units']} per turn",
            exit_code=EXIT_USAGE,
        )
    rad = rad or math.tau / units_per_rotation
    widths = {test.shape[1] if test.ndim == 2 else 0 for test in tests}
    if not tests or len(widths) > 1 or min(widths) < 4:
        raise ThumperError(
            f"{path}: not a SysId recording (rows of {sorted(widths)} values); pass a CSV file",
            exit_code=EXIT_USAGE,
        )
    rows = np.concatenate(tests)
    check_time(rows[:, 0], "time")
    if min(widths) >= 7:
        return [_log(tests, name, voltage, position, rad) for name, voltage, position in SIDES]
    warnings = (gravity,) if gravity else ()
    if _repeats(rows[:, 2], rows[:, 3]):
        return [_log(tests, path.stem, 1, 3, rad, is_speed=True, warnings=warnings)]
    return [_log(tests, path.stem, 1, 2, rad, warnings=warnings)]


def _repeats(position: FloatArray, speed: FloatArray) -> bool:
    """Return whether most positions repeat the one before in motion: the sensor is slower than the rows.

    The differences then jitter more than the reported speeds.
    """
    moving = np.abs(speed[1:]) > 0.2 * np.abs(speed).max()
    return bool(moving.any()) and float(np.mean(np.diff(position)[moving] == 0.0)) > 0.5


def _log(
    tests: list[FloatArray],
    name: str,
    voltage: int,
    column: int,
    rad: float,
    *,
    is_speed: bool = False,
    warnings: tuple[str, ...] = (),
) -> MotorLog:
    starts_segment = np.concatenate([np.arange(len(test)) == 0 for test in tests])
    rows = np.concatenate(tests)
    return MotorLog(
        name=name,
        drive_unit=DriveUnit.VOLT,
        time_s=rows[:, 0],
        drive=rows[:, voltage],
        starts_segment=starts_segment,
        columns=(
            "time: SysId's first value [s]",
            f"drive: SysId's voltage [V, {rows[:, voltage].min():.3g} ... {rows[:, voltage].max():.3g}]",
            f"output: SysId's {'velocity' if is_speed else 'position'}, taken as {rad:.4g} rad per unit",
        ),
        position_rad=None if is_speed else rows[:, column] * rad,
        speed_rad_s=rows[:, column] * rad if is_speed else None,
        warnings=warnings,
    )
