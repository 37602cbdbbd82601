"""The identification experiment on a board: drive, record, and always leave what was recorded."""

import csv
import math
from collections.abc import Callable
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import State
from thumper.common.stamps import epoch_ns_at
from thumper_tuning.drive.board_gains import armed, beat
from thumper_tuning.drive.excitation import ExcitationOptions, blocks

Show = Callable[[int, int, str], None]  # done, total, what

SLOWING_M = 0.25  # a block ends at least this far before the lane does
COASTING_M_S2 = 0.8  # the robot at PWM 0 slows down by at least this; simulated: 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LogRow:
    """A line of the log; the names are the CSV's header and what `tune fit` reads."""

    time_s: float
    left_pwm: int
    left_counts: int
    right_pwm: int
    right_counts: int
    battery_V: float
    left_current_A: float
    right_current_A: float


def record(board: Board, options: ExcitationOptions, path: Path, show: Show) -> Path:
    """Drive the experiment along the lane and write the CSV, also when it is cut short.

    Beside it, under the same name, an MCAP recording holds all that the board said.

    Raises
    ------
    ThumperError
        The board fails; motors are stopped, the log so far is written.
    """
    from thumper.recording.wheel_csv import write_wheels  # loads the ROS 2 types

    samples: list[TelemetrySample] = []
    try:
        with armed(board):
            _drive(board, options, samples, show)
    finally:
        write_rows(path, [_row(sample) for sample in samples])
        epoch_ns = 0 if board.port.has_simulated_clock else epoch_ns_at(board.now_s())
        write_wheels(path.with_suffix(".mcap"), samples, epoch_ns)
    return path


def _drive(board: Board, options: ExcitationOptions, samples: list[TelemetrySample], show: Show) -> None:
    rate_Hz = board.identity.control_rate_Hz
    m_per_count = 2e-3 * math.pi * board.identity.wheel_radius_mm / board.identity.counts_per_rev
    experiment = blocks(options, rate_Hz)
    total, done = sum(len(block.levels) for block in experiment), 0
    board.set_motor_pwm(0, 0)
    first = beat(board, State.MANUAL)
    start = first.telemetry.left_count + first.telemetry.right_count
    where_m, step_m, side = 0.0, 0.0, -1
    for block in experiment:
        side, free = _side(where_m, side, options.lane_m), True
        for level in block.levels.tolist():
            slowing_m = max(SLOWING_M, (step_m * rate_Hz) ** 2 / (2.0 * COASTING_M_S2) + step_m)
            free = free and side * where_m < options.lane_m - slowing_m
            pwm = side * level if free else 0
            board.set_motor_pwm(pwm, pwm)
            sample = beat(board, State.MANUAL)
            samples.append(sample)
            counts = sample.telemetry.left_count + sample.telemetry.right_count - start
            step_m = abs(0.5 * counts * m_per_count - where_m)
            where_m = 0.5 * counts * m_per_count
            done += 1
            show(done, total, block.name)


def _side(where_m: float, before: int, lane_m: float) -> int:
    """The other way than before, unless that way there is no room."""
    if abs(where_m) > 0.5 * lane_m:
        return -1 if where_m > 0.0 else 1
    return -before


def _row(sample: TelemetrySample) -> LogRow:
    telemetry = sample.telemetry
    return LogRow(
        time_s=sample.time_s,
        left_pwm=telemetry.left_pwm,
        left_counts=telemetry.left_count,
        right_pwm=telemetry.right_pwm,
        right_counts=telemetry.right_count,
        battery_V=telemetry.battery_mV / 1000.0,
        left_current_A=telemetry.left_current_mA / 1000.0,
        right_current_A=telemetry.right_current_mA / 1000.0,
    )


def write_rows(path: Path, rows: list[LogRow]) -> None:
    """Write the CSV that `thumper tune fit` reads."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([field.name for field in fields(LogRow)])
        writer.writerows(
            [f"{value:.6f}" if isinstance(value, float) else value for value in astuple(row)] for row in rows
        )
