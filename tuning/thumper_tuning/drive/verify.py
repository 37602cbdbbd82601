"""The proof on the robot: follow trapezoids there and back, and measure the same-tick tracking error."""

import csv
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le, MinLen

from thumper.board.board import Board
from thumper.board.messages import State
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray
from thumper.common.kinematics import WheelSpeeds
from thumper_tuning.design.fixed_point import BoardGains
from thumper_tuning.drive.board_gains import armed, beat, wait_for_rest, write_gains
from thumper_tuning.drive.record import Show

COLUMNS = ("time_s", "acceleration", "direction", "left_setpoint", "left_speed", "left_pwm",
           "right_setpoint", "right_speed", "right_pwm", "battery_V")  # fmt: skip
SETTLE_S = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class VerifyOptions:
    """The trapezoid 0 - speed - 0, driven forward and then backward at each acceleration."""

    speed_rad_s: Annotated[float, Gt(0), Le(13)] = 8.0
    hold_s: Annotated[float, Ge(0)] = 1.5
    accelerations_rad_s2: Annotated[tuple[Annotated[float, Gt(0), Le(200)], ...], MinLen(1)] = (4.0, 8.0)

    def lane_m(self, radius_m: float) -> float:
        """Free floor that it needs ahead."""
        slowest = min(self.accelerations_rad_s2)
        return radius_m * self.speed_rad_s * (self.hold_s + self.speed_rad_s / slowest)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracking:
    """Set-point minus counted speed of the same tick, both wheels [rad/s]."""

    acceleration_rad_s2: float
    mean_rad_s: float
    std_rad_s: float
    largest_rad_s: float
    floor_rad_s: float  # std of the set-point's own change a tick: what a loop without preview cannot beat


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Verification:
    """What was driven, shape (n, len(COLUMNS)), and how well."""

    gains: BoardGains
    rows: FloatArray
    tracking: tuple[Tracking, ...]


def verify(board: Board, gains: BoardGains, options: VerifyOptions, path: Path, show: Show) -> Verification:
    """Set the gains, drive, and write what happened as CSV, also when it is cut short.

    The board keeps the gains; its acceleration is `gains.acceleration` again at the end.
    """
    rows: list[tuple[float, ...]] = []
    rate_Hz = board.identity.control_rate_Hz
    total = sum(2 * _ticks(options, a, rate_Hz) for a in options.accelerations_rad_s2)
    try:
        wait_for_rest(board)
        for acceleration in options.accelerations_rad_s2:
            write_gains(board, replace(gains, acceleration=acceleration))
            with armed(board):
                for direction in (1.0, -1.0):
                    _trapezoid(board, direction, acceleration, options, rows, total, show)
    finally:
        with suppress(ThumperError):  # a board that is gone has forgotten them all
            board.set_parameter("acceleration", gains.acceleration)
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(COLUMNS)
            writer.writerows([f"{value:.6g}" for value in row] for row in rows)
    data = np.array(rows)
    return Verification(
        gains=gains,
        rows=data,
        tracking=tuple(_tracking(data[data[:, 1] == a], a) for a in options.accelerations_rad_s2),
    )


def _ticks(options: VerifyOptions, acceleration: float, rate_Hz: float) -> int:
    return round((options.hold_s + 2.0 * options.speed_rad_s / acceleration + SETTLE_S) * rate_Hz)


def _trapezoid(
    board: Board,
    direction: float,
    acceleration: float,
    options: VerifyOptions,
    rows: list[tuple[float, ...]],
    total: int,
    show: Show,
) -> None:
    """Up, hold, down: the board owns the ramps, the host sends the two corners."""
    rate_Hz = board.identity.control_rate_Hz
    up = round((options.speed_rad_s / acceleration + options.hold_s) * rate_Hz)
    for tick in range(_ticks(options, acceleration, rate_Hz)):
        speed = direction * options.speed_rad_s if tick < up else 0.0
        board.set_wheel_speeds(WheelSpeeds(left_rad_s=speed, right_rad_s=speed))
        sample = beat(board, State.CLOSED_LOOP)
        t = sample.telemetry
        left = (t.left_setpoint / 1e3, t.left_speed / 1e3, t.left_pwm)
        right = (t.right_setpoint / 1e3, t.right_speed / 1e3, t.right_pwm)
        rows.append((sample.time_s, acceleration, direction, *left, *right, t.battery_mV / 1e3))
        show(len(rows), total, f"{acceleration:g} rad/s^2")


def _tracking(rows: FloatArray, acceleration: float) -> Tracking:
    way = rows[:, 2]  # forward and backward: lagging is positive in both, so that the mean cannot cancel
    error = np.concatenate((way * (rows[:, 3] - rows[:, 4]), way * (rows[:, 6] - rows[:, 7])))
    return Tracking(
        acceleration_rad_s2=acceleration,
        mean_rad_s=float(error.mean()),
        std_rad_s=float(error.std()),
        largest_rad_s=float(np.abs(error).max()),
        floor_rad_s=float(np.std(np.diff(rows[:, 3]))),
    )
