"""Drive a course on a board and note the counts; motors stop first, whatever ends it."""

from collections.abc import Callable

import numpy as np

from thumper.board.board import Board, TelemetrySample
from thumper.board.messages import State
from thumper.common.geometry import FloatArray, Twist2
from thumper.common.kinematics import DriveGeometry, wheel_speeds
from thumper.odometry.wheel_odometry import count_delta
from thumper_tuning.calibration.course import Leg
from thumper_tuning.drive.board_gains import armed, beat
from thumper_tuning.drive.record import Show

REST_S = 0.8  # at the end the robot rolls out, and the last counts come

Look = Callable[[TelemetrySample], None]


def drive(board: Board, legs: list[Leg], geometry: DriveGeometry, show: Show, look: Look) -> FloatArray:
    """Return time [s] and both counts a tick, shape (n, 3), counts from zero and past the int32 wrap.

    Raises
    ------
    ThumperError
        The board fails or stops the motors; they stand then.
    """
    rate_Hz = board.identity.control_rate_Hz
    rows: list[tuple[float, float, float]] = []
    rest = Leg(twist=Twist2(), duration_s=REST_S)
    total = sum(round(leg.duration_s * rate_Hz) for leg in [*legs, rest])
    left = right = 0
    before: tuple[int, int] | None = None
    with armed(board):
        for leg in [*legs, rest]:
            speeds = wheel_speeds(leg.twist, geometry)
            for _ in range(round(leg.duration_s * rate_Hz)):
                board.set_wheel_speeds(speeds)
                sample = beat(board, State.CLOSED_LOOP)
                now = (sample.telemetry.left_count, sample.telemetry.right_count)
                if before is not None:
                    left += count_delta(before[0], now[0])
                    right += count_delta(before[1], now[1])
                before = now
                rows.append((sample.time_s, float(left), float(right)))
                look(sample)
                show(len(rows), total, "driving")
    return np.array(rows)
