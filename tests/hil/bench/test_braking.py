"""The way from the command to stop until the wheels rest, on the emulated board."""

from contextlib import closing

import numpy as np
import pytest

from thumper.board.board import Board
from thumper.board.messages import Command, Fault
from thumper.board.options import BoardOptions
from thumper.common.geometry import Twist2
from thumper.common.kinematics import DriveGeometry, wheel_speeds
from thumper_hil.bench import simulation
from thumper_hil.bench.registry import forget_simulation

PERIOD_S, DRIVE_S, STOP_S = 0.05, 2.0, 1.5
TELEMETRY_S = 0.5


def stopping_way_m(preset: str, deceleration_rad_s2: float) -> float:
    """Return the way after the command to stop from 0.4 m/s."""
    with closing(Board.open(f"sim://braking/board?preset={preset}", baud=BoardOptions().baud)) as board:
        bench = simulation("braking")
        board.set_parameter("deceleration", deceleration_rad_s2)
        board.command(Command.ARM)
        for twist, duration_s in ((Twist2(v_m_s=0.4), DRIVE_S), (Twist2(), STOP_S)):
            start_s = bench.time_s
            while bench.time_s < start_s + duration_s - 1e-6:
                board.set_wheel_speeds(wheel_speeds(twist, DriveGeometry()))
                board.poll(PERIOD_S)
        telemetry = board.poll(TELEMETRY_S)[-1].telemetry
        assert telemetry.fault is Fault.NONE
        assert telemetry.left_speed == telemetry.right_speed == 0
        truth = bench.truth()
    forget_simulation("braking")
    stopping = truth[truth[:, 0] >= start_s, 1:3]
    return float(np.hypot(*np.diff(stopping, axis=0).T).sum())


@pytest.mark.parametrize("preset", ["nominal", "hard"])
def test_it_stops_in_less_way_than_it_speeds_up(preset: str) -> None:
    """About 0.10 and 0.09 m were measured, and 0.18 and 0.16 m at the acceleration's 8 rad/s^2."""
    way_m = stopping_way_m(preset, 16.0)
    assert 0.07 < way_m < 0.11
    assert stopping_way_m(preset, 0.0) > 1.6 * way_m
