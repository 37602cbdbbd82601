"""Computing takes simulated time: commands go out late, and a host that is too slow loses the link."""

import time
from dataclasses import replace
from unittest.mock import patch

import pytest

from thumper.board.board import Board
from thumper.board.messages import Command, Fault
from thumper.common.kinematics import WheelSpeeds
from thumper_hil.bench import Bench, simulation
from thumper_hil.effects.host_time import HostTime
from thumper_hil.effects.preset import HostEffects, load_preset

FAST = load_preset("nominal").host
SLOW = replace(FAST, cpu_factor=4.0)


def compute(cpu_s: float) -> None:
    """Keep the processor busy for this much CPU time of the thread."""
    until_s = time.thread_time() + cpu_s
    while time.thread_time() < until_s:
        pass


def open_board(name: str, host: HostEffects) -> tuple[Board, Bench]:
    preset = replace(load_preset("nominal"), host=host)
    with patch("thumper_hil.bench.bench.load_preset", lambda _name: preset):
        board = Board.open(f"sim://{name}/board?world=hall", baud=500_000)
    return board, simulation(name)


def drive(board: Board, cycles: int, cpu_s: float) -> Fault:
    """Drive for some cycles that compute this long; return the board's fault."""
    board.command(Command.ARM)
    fault = Fault.NONE
    for _ in range(cycles):
        board.set_wheel_speeds(WheelSpeeds(left_rad_s=4.0, right_rad_s=4.0))
        for sample in board.poll(0.5):
            fault = Fault(sample.telemetry.fault)
        compute(cpu_s)
    return fault


def test_computing_delays_the_command() -> None:
    board, bench = open_board("late", SLOW)
    board.poll(0.5)
    before_s = bench.time_s
    compute(0.02)
    board.set_wheel_speeds(WheelSpeeds(left_rad_s=0.0, right_rad_s=0.0))
    assert bench.time_s - before_s == pytest.approx(0.08, rel=0.3)
    assert bench.host.charged_s > 0.07
    board.close()


def test_without_a_factor_computing_is_free() -> None:
    board, bench = open_board("free", FAST)
    board.poll(0.5)
    before_s = bench.time_s
    compute(0.02)
    board.set_wheel_speeds(WheelSpeeds(left_rad_s=0.0, right_rad_s=0.0))
    assert bench.time_s == before_s
    board.close()


def test_a_host_that_is_too_slow_loses_the_link() -> None:
    """The firmware's time-out of 0.3 s sees the simulated delay of 0.4 s, but not one of 0.1 s."""
    board, _ = open_board("slow", SLOW)
    assert drive(board, 6, 0.1) is Fault.LINK_LOST
    board.close()
    board, _ = open_board("slow enough", SLOW)
    assert drive(board, 6, 0.025) is Fault.NONE
    board.close()


def test_waking_up_is_late_and_seldom_very_late() -> None:
    host = HostTime(load_preset("hard").host, seed=1)
    delays_s = sorted(host.wake_up_s() for _ in range(5000))
    assert delays_s[0] >= 0.0
    assert delays_s[2500] == pytest.approx(0.009, abs=0.002)  # half of the latency timer, and the scheduler
    assert delays_s[-1] > 0.05
    assert sum(delay_s > 0.05 for delay_s in delays_s) < 30
