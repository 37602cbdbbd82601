"""Read WPILib SysId drive-train recordings: four tests, two sides, voltages, positions and speeds."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from thumper.common.errors import EXIT_CHECK_FAILED, EXIT_USAGE, ThumperError
from thumper.common.files import read_text
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog

MAX_MB = 200.0
TESTS = ("slow-forward", "slow-backward", "fast-forward", "fast-backward")
SIDES = (("left", 1, 3), ("right", 2, 4))  # name, column of the voltage, column of the position
UNIT_RAD = {"Rotations": math.tau, "Radians": 1.0, "Degrees": math.pi / 180.0}


def read_sysid(path: Path) -> list[MotorLog]:
    """Read a drive-train recording; `unitsPerRotation` converts metres to radians of the wheel.

    Uses the positions, not the reported speeds: those were filtered, and the file does not say how.

    Raises
    ------
    ThumperError
        The file is not a SysId drive-train recording.
    """
    try:
        data = json.loads(read_text(path, MAX_MB))
        tests = [np.array(data[name], dtype=float) for name in TESTS if data.get(name)]
        rad = UNIT_RAD.get(data["units"], math.tau / float(data["unitsPerRotation"]))
    except OSError as error:
        raise ThumperError(f"{path}: cannot read the log: {error.strerror}", exit_code=EXIT_USAGE) from error
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise ThumperError(
            f"{path}: not a SysId recording ({error}); pass a CSV file", exit_code=EXIT_CHECK_FAILED
        ) from error
    if not tests or any(test.ndim != 2 or test.shape[1] < 7 for test in tests):
        raise ThumperError(
            f"{path}: not a SysId drive-train recording; pass a CSV file", exit_code=EXIT_CHECK_FAILED
        )
    return [_side_log(tests, name, voltage, position, rad) for name, voltage, position in SIDES]


def _side_log(tests: list[Any], name: str, voltage: int, position: int, rad: float) -> MotorLog:
    starts_segment = np.concatenate([np.arange(len(test)) == 0 for test in tests])
    rows = np.concatenate(tests)
    return MotorLog(
        name=name,
        drive_unit=DriveUnit.VOLT,
        time_s=rows[:, 0],
        drive=rows[:, voltage],
        starts_segment=starts_segment,
        position_rad=rows[:, position] * rad,
    )
