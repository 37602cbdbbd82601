"""Drive a course on a board and record the counts; the motors stop first, also after an error."""

from collections.abc import Callable

import numpy as np

from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import State
from thumper.common.geometry import FloatArray, Twist2
from thumper.common.kinematics import DriveGeometry, wheel_speeds
from thumper.odometry.wheel_odometry import count_delta
from thumper_tuning.calibration.course import CourseLeg
from thumper_tuning.drive.board_gains import armed, next_sample
from thumper_tuning.drive.record import ReportProgress

REST_S = 0.8  # at the end the robot coasts, and the last counts arrive

OnSample = Callable[[TelemetrySample], None]


def drive_course(
    board: Board,
    legs: list[CourseLeg],
    geometry: DriveGeometry,
    report_progress: ReportProgress,
    on_sample: OnSample,
) -> FloatArray:
    """Return time [s] and both counts per tick, shape (n, 3); counts start at 0 and do not wrap.

    Raises
    ------
    ThumperError
        The board fails or stops the motors. The motors are stopped.
    """
    rate_Hz = board.identity.control_rate_Hz
    rows: list[tuple[float, float, float]] = []
    rest = CourseLeg(twist=Twist2(), duration_s=REST_S)
    total = sum(round(leg.duration_s * rate_Hz) for leg in [*legs, rest])
    left = right = 0
    previous: tuple[int, int] | None = None
    with armed(board):
        for leg in [*legs, rest]:
            speeds = wheel_speeds(leg.twist, geometry)
            for _ in range(round(leg.duration_s * rate_Hz)):
                board.set_wheel_speeds(speeds)
                sample = next_sample(board, State.CLOSED_LOOP)
                counts = (sample.telemetry.left_count, sample.telemetry.right_count)
                if previous is not None:
                    left += count_delta(previous[0], counts[0])
                    right += count_delta(previous[1], counts[1])
                previous = counts
                rows.append((sample.time_s, float(left), float(right)))
                on_sample(sample)
                report_progress(len(rows), total, "driving")
    return np.array(rows)
