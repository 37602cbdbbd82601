"""Drive the identification experiment on a board, and write what was recorded."""

from collections.abc import Callable
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import State
from thumper.common.files import write_csv
from thumper.common.stamps import epoch_ns_at
from thumper_tuning.drive.board_gains import armed, next_sample
from thumper_tuning.drive.excitation import ExcitationOptions, excitation_blocks
from thumper_tuning.drive.return_to_start import m_per_count

ReportProgress = Callable[[int, int, str], None]  # done, total, activity

MIN_STOPPING_M = 0.25  # a block ends at least this far before the end of the lane
COASTING_M_S2 = 0.8  # the robot decelerates by at least this at PWM 0; simulated: 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LogRow:
    """One row of the log. The names are the header of the CSV, which `tune fit` reads."""

    time_s: float
    left_pwm: int
    left_counts: int
    right_pwm: int
    right_counts: int
    battery_V: float
    left_current_A: float
    right_current_A: float


def record(board: Board, options: ExcitationOptions, path: Path, report_progress: ReportProgress) -> Path:
    """Drive the experiment along the lane and write the CSV, also if it is interrupted.

    Nothing is written if the board refuses to start: an earlier log of that name stays. An MCAP recording
    of the same name holds all telemetry of the board.

    Raises
    ------
    ThumperError
        The board fails. The motors are stopped, and the log so far is written.
    """
    from thumper.recording.wheel_csv import write_wheels  # loads the ROS 2 types

    samples: list[TelemetrySample] = []
    try:
        with armed(board):
            _drive(board, options, samples, report_progress)
    finally:
        if samples:
            _write_csv(path, [_row(sample) for sample in samples])
            epoch_ns = 0 if board.port.has_simulated_clock else epoch_ns_at(board.now_s())
            write_wheels(path.with_suffix(".mcap"), samples, epoch_ns)
    return path


def _drive(
    board: Board,
    options: ExcitationOptions,
    samples: list[TelemetrySample],
    report_progress: ReportProgress,
) -> None:
    rate_Hz = board.identity.control_rate_Hz
    blocks = excitation_blocks(options, rate_Hz)
    total, done = sum(len(block.levels) for block in blocks), 0
    board.set_motor_pwm(0, 0)
    first = next_sample(board, State.MANUAL)
    start = first.telemetry.left_count + first.telemetry.right_count
    count_m = m_per_count(board)
    position_m, step_m, direction = 0.0, 0.0, -1
    for block in blocks:
        direction, has_room = _next_direction(position_m, direction, options.lane_m), True
        for level in block.levels.tolist():
            stopping_m = max(MIN_STOPPING_M, (step_m * rate_Hz) ** 2 / (2.0 * COASTING_M_S2) + step_m)
            has_room = has_room and direction * position_m < options.lane_m - stopping_m
            pwm = direction * level if has_room else 0
            board.set_motor_pwm(pwm, pwm)
            sample = next_sample(board, State.MANUAL)
            samples.append(sample)
            counts = sample.telemetry.left_count + sample.telemetry.right_count - start
            step_m = abs(0.5 * counts * count_m - position_m)
            position_m = 0.5 * counts * count_m
            done += 1
            report_progress(done, total, block.name)


def _next_direction(position_m: float, previous: int, lane_m: float) -> int:
    """Return the opposite direction, unless there is no room in it."""
    if abs(position_m) > 0.5 * lane_m:
        return -1 if position_m > 0.0 else 1
    return -previous


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


def _write_csv(path: Path, rows: list[LogRow]) -> None:
    table = (
        [f"{value:.6f}" if isinstance(value, float) else value for value in astuple(row)] for row in rows
    )
    write_csv(path, [field.name for field in fields(LogRow)], table)
