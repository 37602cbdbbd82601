"""Test the real firmware ELF on the simulated robot: handshake, speed control, safety stops."""

from collections.abc import Callable, Iterator

import pytest

from thumper.board.board import Board
from thumper.board.framing import encode_frame
from thumper.board.messages import Command, Fault, Identify, ResetCause, SetMotorPwm, State
from thumper.common.errors import ThumperError
from thumper.common.kinematics import WheelSpeeds
from thumper_hil.bench import Bench, simulation

NAME = "firmware-test"
Open = Callable[[str], tuple[Board, Bench]]


@pytest.fixture
def open_board() -> Iterator[Open]:
    """Return a function that opens the board with these options: (board, bench)."""
    boards = []

    def open_(options: str = "") -> tuple[Board, Bench]:
        board = Board.open(f"sim://{NAME}/board?{options}", baud=500_000)
        boards.append(board)
        return board, simulation(NAME)

    yield open_
    for board in boards:
        board.close()


def drive(board: Board, bench: Bench, speeds: WheelSpeeds, seconds: float) -> None:
    """Command the speeds at each telemetry message."""
    until_s = bench.time_s + seconds
    while bench.time_s < until_s:
        board.set_wheel_speeds(speeds)
        board.poll(0.5)


def test_handshake(open_board: Open) -> None:
    board, bench = open_board("")
    assert board.identity.counts_per_rev == 1200
    assert board.identity.reset_cause == ResetCause.POWER_ON
    assert bench.time_s < 0.5
    assert bench.chip.overruns == 0


@pytest.mark.parametrize(("left_rad_s", "right_rad_s"), [(5.0, 5.0), (8.0, 6.0), (-4.0, -4.0), (-3.0, 3.0)])
def test_wheels_follow_the_commanded_speeds(open_board: Open, left_rad_s: float, right_rad_s: float) -> None:
    """The settled mean over one second is within 2 %, and every edge is counted."""
    board, bench = open_board("")
    board.command(Command.ARM)
    speeds = WheelSpeeds(left_rad_s=left_rad_s, right_rad_s=right_rad_s)
    drive(board, bench, speeds, 2.0)
    drive(board, bench, speeds, 1.0)
    mean = bench.truth()[-100:, 4:6].mean(axis=0)
    assert mean == pytest.approx([left_rad_s, right_rad_s], rel=0.02)
    telemetry = board.poll(0.2)[-1].telemetry
    assert telemetry.lost_edges == 0
    assert telemetry.state is State.CLOSED_LOOP


def test_a_silent_host_stops_the_robot(open_board: Open) -> None:
    """The PWM is off 300 ms after the last command; half a second after it no motor has torque."""
    board, bench = open_board("")
    board.command(Command.ARM)
    drive(board, bench, WheelSpeeds(left_rad_s=8.0, right_rad_s=8.0), 2.0)
    silent_s = bench.time_s
    bench.advance(silent_s + 0.5)
    assert [bench.chip.data(address) for address in (0xB3, 0xB4)] == [0, 0]  # OCR2A, OCR2B
    bench.advance(silent_s + 1.0)
    assert bench.chip.truth().wheel_rad_s == (0.0, 0.0)
    telemetry = board.poll(0.3)[-1].telemetry
    assert (telemetry.state, telemetry.fault) == (State.FAULT, Fault.LINK_LOST)


def test_a_low_battery_stops_the_robot(open_board: Open) -> None:
    """At 2 % charge the battery has 6.3 V: the firmware refuses to drive and reports why."""
    board, bench = open_board("charge=0.02")
    bench.advance(bench.time_s + 5.0)  # time to detect the low battery and to beep
    with pytest.raises(ThumperError, match=r"refused|battery"):
        board.command(Command.ARM)
    board.poll(0.3)
    telemetry = board.poll(0.3)[-1].telemetry
    assert telemetry.fault is Fault.LOW_BATTERY
    assert telemetry.battery_mV == pytest.approx(1000 * bench.chip.truth().battery_V, abs=40)
    assert abs(bench.truth()[-1, 1:3]).max() < 0.01


def test_no_edge_is_lost_at_full_speed_with_a_busy_link(open_board: Open) -> None:
    """Full PWM on a full battery: above 14 rad/s, 5300 edges/s, while requests keep the line full."""
    board, bench = open_board("charge=1&x_m=-1.2")
    port = board._port.raw  # bypass the client, which would wait for answers
    board.command(Command.ARM)
    request = encode_frame(Identify.ID, 7, Identify().pack())
    push = SetMotorPwm(left=255, right=255)
    full_speed = False
    for _ in range(90):
        # The answers fill the line. With more requests than these the board would drop commands as well.
        port.write(5 * (encode_frame(push.ID, 8, push.pack()) + request * 3))
        bench.advance(bench.time_s + 0.01)
        port.reset_input_buffer()
        full_speed = full_speed or min(bench.chip.truth().wheel_rad_s) > 14.0
    assert full_speed
    stop = SetMotorPwm(left=0, right=0)
    while max(bench.chip.truth().wheel_rad_s) > 0.0:  # the robot rolls on without drive
        port.write(encode_frame(stop.ID, 9, stop.pack()))
        bench.advance(bench.time_s + 0.1)
    board.poll(0.3)
    telemetry = board.poll(0.3)[-1].telemetry
    truth = bench.chip.truth()
    assert telemetry.lost_edges == 0
    assert (telemetry.left_count, telemetry.right_count) == truth.encoder_count
    assert telemetry.left_count > 2000
    assert bench.chip.overruns == 0


def test_wrong_baud_rate_is_reported() -> None:
    with pytest.raises(ThumperError, match="no Thumper board answers"):
        Board.open(f"sim://{NAME}/board", baud=115_200)
