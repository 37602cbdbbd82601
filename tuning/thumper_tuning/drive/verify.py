"""Verify gains on the robot: follow trapezoids forward and backward, and measure the tracking error."""

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le, MinLen

from thumper.board.board import Board
from thumper.board.messages import State
from thumper.common.errors import ThumperError
from thumper.common.files import write_csv
from thumper.common.geometry import FloatArray
from thumper.common.kinematics import WheelSpeeds
from thumper_tuning.design.fixed_point import BoardGains
from thumper_tuning.drive.board_gains import armed, next_sample, wait_until_stopped, write_gains
from thumper_tuning.drive.record import ReportProgress

COLUMNS = (
    "time_s",
    "acceleration",
    "direction",
    "left_setpoint",
    "left_speed",
    "left_pwm",
    "right_setpoint",
    "right_speed",
    "right_pwm",
    "battery_V",
)
SETTLE_S = 1.0
BLOCK_TICKS = 10  # longer than the errors of a tick last
LANE_MARGIN_M = 0.05  # overshoot at the top, and the error of the start after `return_to`

Row = tuple[float, ...]  # a value per column


@dataclass(frozen=True, slots=True, kw_only=True)
class VerifyOptions:
    """The trapezoid 0 - speed - 0, driven forward and then backward at each acceleration."""

    speed_rad_s: Annotated[float, Gt(0), Le(13)] = 8.0
    hold_s: Annotated[float, Ge(0)] = 1.5
    accelerations_rad_s2: Annotated[tuple[Annotated[float, Gt(0), Le(200)], ...], MinLen(1)] = (4.0, 8.0)

    def lane_m(self, radius_m: float) -> float:
        """Return the free floor that the drive needs ahead of its start, rounded up to 0.1 m."""
        slowest = min(self.accelerations_rad_s2)
        length_m = radius_m * self.speed_rad_s * (self.hold_s + self.speed_rad_s / slowest)
        return math.ceil(10.0 * (length_m + LANE_MARGIN_M)) / 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingError:
    """Set-point minus counted speed of the same tick, both wheels [rad/s]."""

    acceleration_rad_s2: float
    mean_rad_s: float
    std_rad_s: float
    std_error_rad_s: float  # standard error of that, by the spread between seconds of the drive
    max_rad_s: float
    no_preview_std_rad_s: float  # std of the set-point's change per tick: the limit without preview


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Verification:
    """The recorded rows, shape (n, len(COLUMNS)), and the tracking error of each ramp."""

    gains: BoardGains
    rows: FloatArray
    tracking: tuple[TrackingError, ...]


def verify(
    board: Board,
    gains: BoardGains,
    options: VerifyOptions,
    path: Path,
    report_progress: ReportProgress,
) -> Verification:
    """Set the gains, drive the trapezoids, and write a CSV, also if the drive is interrupted.

    Nothing is written if the board refuses to start: an earlier file of that name stays. The board keeps
    the gains. At the end its acceleration and its deceleration are as before.
    """
    rows: list[Row] = []
    drive = _TrapezoidDrive(board, options, rows, report_progress)
    deceleration = board.get_parameter("deceleration")
    try:
        wait_until_stopped(board)
        board.set_parameter("deceleration", 0.0)  # as the acceleration
        for acceleration in options.accelerations_rad_s2:
            write_gains(board, replace(gains, acceleration=acceleration))
            with armed(board):
                for direction in (1.0, -1.0):
                    drive.run(direction, acceleration)
    finally:
        with suppress(ThumperError):  # a disconnected board has lost the gains anyway
            board.set_parameter("acceleration", gains.acceleration)
            board.set_parameter("deceleration", deceleration)
        if rows:
            _write_csv(path, rows)
    data = np.array(rows)
    return Verification(
        gains=gains,
        rows=data,
        tracking=tuple(tracking_error(data[data[:, 1] == a], a) for a in options.accelerations_rad_s2),
    )


def _write_csv(path: Path, rows: list[Row]) -> None:
    write_csv(path, COLUMNS, ([f"{value:.6g}" for value in row] for row in rows))


class _TrapezoidDrive:
    """Drives trapezoids and appends a row per tick."""

    def __init__(
        self, board: Board, options: VerifyOptions, rows: list[Row], report_progress: ReportProgress
    ) -> None:
        self._board = board
        self._options = options
        self._rows = rows
        self._report_progress = report_progress
        self._rate_Hz = board.identity.control_rate_Hz
        self._total = sum(2 * self._ticks(a) for a in options.accelerations_rad_s2)

    def _ticks(self, acceleration: float) -> int:
        options = self._options
        duration_s = options.hold_s + 2.0 * options.speed_rad_s / acceleration + SETTLE_S
        return round(duration_s * self._rate_Hz)

    def run(self, direction: float, acceleration: float) -> None:
        """Accelerate, hold, decelerate: the host sends the two corners, the board makes the ramps."""
        options = self._options
        up = round((options.speed_rad_s / acceleration + options.hold_s) * self._rate_Hz)
        for tick in range(self._ticks(acceleration)):
            speed = direction * options.speed_rad_s if tick < up else 0.0
            self._board.set_wheel_speeds(WheelSpeeds(left_rad_s=speed, right_rad_s=speed))
            sample = next_sample(self._board, State.CLOSED_LOOP)
            t = sample.telemetry
            left = (t.left_setpoint / 1e3, t.left_speed / 1e3, t.left_pwm)
            right = (t.right_setpoint / 1e3, t.right_speed / 1e3, t.right_pwm)
            self._rows.append((sample.time_s, acceleration, direction, *left, *right, t.battery_mV / 1e3))
            self._report_progress(len(self._rows), self._total, f"speeding up at {acceleration:g} rad/s²")


def tracking_error(rows: FloatArray, acceleration: float) -> TrackingError:
    """Return the tracking error of a ramp from its rows, shape (n, len(COLUMNS))."""
    direction = rows[:, 2]  # a lag is positive both forward and backward, so the mean cannot cancel it
    error = np.concatenate((direction * (rows[:, 3] - rows[:, 4]), direction * (rows[:, 6] - rows[:, 7])))
    squares = ((error - error.mean()) ** 2).reshape(2, -1).mean(axis=0)  # of both wheels: they move together
    means = [float(np.mean(part)) for part in np.array_split(squares, max(len(squares) // BLOCK_TICKS, 2))]
    variance_error = float(np.std(means, ddof=1)) / math.sqrt(len(means))
    return TrackingError(
        acceleration_rad_s2=acceleration,
        mean_rad_s=float(error.mean()),
        std_rad_s=float(error.std()),
        std_error_rad_s=variance_error / (2.0 * max(float(error.std()), 1e-9)),
        max_rad_s=float(np.abs(error).max()),
        no_preview_std_rad_s=float(np.std(np.diff(rows[:, 3]))),
    )
