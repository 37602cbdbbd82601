"""Checks of the motor board: link, telemetry, battery and, with consent, the encoder directions."""

from collections.abc import Callable, Iterator

import numpy as np

from thumper.board.board import Board, TelemetrySample
from thumper.board.gyroscope import check_gyroscope
from thumper.board.messages import Command, GyroscopeState, Telemetry
from thumper.board.options import BoardOptions
from thumper.common.errors import ThumperError
from thumper.common.serial_port import SerialPort, open_port
from thumper.doctor.check import Check
from thumper.doctor.verdicts import (
    BOARD_JITTER_FAIL_S,
    BOARD_JITTER_WARN_S,
    BOARD_ROUND_TRIP_FAIL_S,
    BOARD_ROUND_TRIP_WARN_S,
    Limits,
    Stream,
    judge_battery,
    judge_round_trip,
    judge_spin,
    judge_stream,
    measure_round_trips,
)
from thumper.odometry.wheel_odometry import count_delta

SPIN_PWM, SPIN_S, SETTLE_S = 60, 0.8, 0.5  # a quarter of full power
POLL_S = 0.2
OnTurning = Callable[[TelemetrySample], None]


def check_board(
    config: BoardOptions,
    *,
    seconds: float,
    spin: Callable[[], bool] | None,
    also: Iterator[Check],
    needs_gyroscope: bool = False,
    on_turning: OnTurning = lambda sample: None,
) -> Iterator[Check]:
    """Check the link and the battery; turn the wheels if `spin` is given and returns True.

    `on_turning` receives the telemetry while they turn. A gyroscope that the board does not use is a failed
    check only with `needs_gyroscope`. `also` are checks to run before the board's port closes: a simulated
    robot ends with its last port.
    """
    port: SerialPort | None = None
    try:
        port = open_port(config.port, baud=config.baud, name="board")
        board = Board(port)
    except ThumperError as error:
        if port is not None:
            port.close()
        yield Check(verdict="fail", what="board", fix=str(error))
        if not config.port.startswith("sim:"):  # else they would check another simulated robot
            yield from also
        return
    try:
        yield from _checks(
            board, config.port, port.now_s, seconds, spin, needs_gyroscope, on_turning=on_turning
        )
        yield from also
    finally:
        board.close()


def _checks(
    board: Board,
    name: str,
    clock_s: Callable[[], float],
    seconds: float,
    spin: Callable[[], bool] | None,
    needs_gyroscope: bool,
    *,
    on_turning: OnTurning,
) -> Iterator[Check]:
    i = board.identity
    version = f"{i.version_major}.{i.version_minor}.{i.version_patch}"
    yield Check(verdict="pass", what=f"board {name}: firmware {version}")
    try:
        trips_s, lost = measure_round_trips(board.round_trip_s)
        yield judge_round_trip("board", trips_s, lost, BOARD_ROUND_TRIP_WARN_S, BOARD_ROUND_TRIP_FAIL_S)
        stream, last = _record(board, clock_s, seconds)
        jitter = Limits(warn_s=BOARD_JITTER_WARN_S, fail_s=BOARD_JITTER_FAIL_S)
        yield from judge_stream("telemetry", stream, jitter)
        if last is not None:
            yield judge_battery(
                1e-3 * last.battery_mV,
                cells=i.battery_cells,
                stop_V=1e-3 * i.battery_cells * i.battery_stop_mV,
                rearm_V=1e-3 * i.battery_cells * i.battery_rearm_mV,
            )
            if needs_gyroscope or last.gyroscope is not GyroscopeState.OFF:
                yield _gyroscope(last.gyroscope)
        if spin is None:
            fix = "lift the wheels, then run with --spin"
            yield Check(verdict="warn", what="encoder directions not checked", fix=fix)
        elif not spin():
            yield Check(verdict="warn", what="encoder directions not checked", fix="you answered no")
        else:
            yield from _spin(board, clock_s, on_turning)
    except ThumperError as error:
        yield Check(verdict="fail", what="board", fix=str(error))


def _gyroscope(state: GyroscopeState) -> Check:
    what = f"gyroscope of the board: {state.name.lower()}"
    try:
        check_gyroscope(state)
    except ThumperError as error:
        return Check(verdict="fail", what=what, fix=str(error))
    if state is GyroscopeState.CALIBRATING:
        return Check(verdict="warn", what=what, fix="leave the robot still for a second, with the motors off")
    return Check(verdict="pass", what=what)


def _record(board: Board, clock_s: Callable[[], float], seconds: float) -> tuple[Stream, Telemetry | None]:
    board.poll(0.0)  # drop what arrived before
    damaged = board.receive_errors
    times_s, arrivals_s = [], []
    first: Telemetry | None = None
    last: Telemetry | None = None
    until_s = clock_s() + seconds
    while clock_s() < until_s:
        for sample in board.poll(POLL_S):
            times_s.append(sample.time_s)
            arrivals_s.append(clock_s())
            last = sample.telemetry
            first = first or last
    damaged = board.receive_errors - damaged
    if first is not None and last is not None:
        damaged += (last.rx_errors - first.rx_errors) % 2**16
    stream = Stream(
        times_s=np.array(times_s),
        arrivals_s=np.array(arrivals_s),
        expected_Hz=float(board.identity.control_rate_Hz),
        damaged=damaged,
    )
    return stream, last


def _spin(board: Board, clock_s: Callable[[], float], on_turning: OnTurning) -> Iterator[Check]:
    """Turn each side alone, forward and slowly; the motors are off between and afterwards."""
    for side in ("left", "right"):
        board.command(Command.CLEAR_FAULT)
        board.command(Command.ARM)
        try:
            start = _drive(board, clock_s, side, 0, 0.1, on_turning)
            end = _drive(board, clock_s, side, SPIN_PWM, SPIN_S, on_turning)
        finally:
            board.set_motor_pwm(0, 0)
            board.command(Command.DISARM)
        _settle(board, clock_s, on_turning)
        left = count_delta(start.left_count, end.left_count)
        right = count_delta(start.right_count, end.right_count)
        own, other = (left, right) if side == "left" else (right, left)
        yield judge_spin(side, own, other, (end.lost_edges - start.lost_edges) % 2**16)


def _drive(
    board: Board, clock_s: Callable[[], float], side: str, pwm: int, seconds: float, on_turning: OnTurning
) -> Telemetry:
    last: Telemetry | None = None
    until_s = clock_s() + seconds
    while clock_s() < until_s:
        board.set_motor_pwm(*((pwm, 0) if side == "left" else (0, pwm)))
        for sample in board.poll(POLL_S):
            last = sample.telemetry
            on_turning(sample)
    if last is None:
        raise ThumperError("the board sent nothing while a wheel was turning; is the cable loose?")
    return last


def _settle(board: Board, clock_s: Callable[[], float], on_turning: OnTurning) -> None:
    until_s = clock_s() + SETTLE_S
    while clock_s() < until_s:
        for sample in board.poll(POLL_S):
            on_turning(sample)
