"""Drive the robot straight back to where an experiment began, by its wheel counts."""

import math

from thumper.board.board import Board
from thumper.board.messages import State
from thumper.common.errors import ThumperError
from thumper.common.kinematics import WheelSpeeds
from thumper_tuning.drive.board_gains import armed, next_sample, wait_until_stopped

SPEED_RAD_S = 3.0
SLOW_RAD_S = 1.0
SLOW_WITHIN_M = 0.15
CLOSE_M = 0.02
TIMEOUT_MARGIN = 2.0  # times the duration at `SPEED_RAD_S`
MIN_TIMEOUT_S = 6.0


def distance_m(board: Board) -> float:
    """Return how far the wheels have driven since the board started, mean of both sides [m]."""
    telemetry = next_sample(board, State.DISARMED).telemetry
    return 0.5 * (telemetry.left_count + telemetry.right_count) * m_per_count(board)


def m_per_count(board: Board) -> float:
    """Return the wheel's travel per encoder count [m]."""
    return 2e-3 * math.pi * board.identity.wheel_radius_mm / board.identity.counts_per_rev


def return_to(board: Board, start_m: float) -> None:
    """Drive straight to a distance that `distance_m` returned, to within 2 cm.

    Raises
    ------
    ThumperError
        The board fails, or the wheels turn and do not come closer in time. The motors are stopped.
    """
    wait_until_stopped(board)
    offset_m = start_m - distance_m(board)
    if abs(offset_m) < CLOSE_M:
        return
    radius_m = board.identity.wheel_radius_mm / 1000.0
    timeout_s = max(TIMEOUT_MARGIN * abs(offset_m) / (radius_m * SPEED_RAD_S), MIN_TIMEOUT_S)
    with armed(board):
        for _ in range(round(timeout_s * board.identity.control_rate_Hz)):
            speed = SPEED_RAD_S if abs(offset_m) > SLOW_WITHIN_M else SLOW_RAD_S
            wheel_rad_s = math.copysign(speed, offset_m)
            board.set_wheel_speeds(WheelSpeeds(left_rad_s=wheel_rad_s, right_rad_s=wheel_rad_s))
            telemetry = next_sample(board, State.CLOSED_LOOP).telemetry
            position_m = 0.5 * (telemetry.left_count + telemetry.right_count) * m_per_count(board)
            offset_m = start_m - position_m
            if abs(offset_m) < CLOSE_M:
                break
        else:
            raise ThumperError(
                f"the robot did not get back to its start ({abs(offset_m):.1f} m away); clear its lane and "
                "start again"
            )
    wait_until_stopped(board)
