"""Each fault has its effect at its time, and firmware and board client detect it."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from thumper.board.board import Board
from thumper.board.messages import Command, Fault, State, Telemetry
from thumper.common.errors import ThumperError
from thumper.common.kinematics import WheelSpeeds
from thumper.runtime.sensor_inputs import LATE_CYCLE_S
from thumper_hil.bench import Bench, simulation

NAME = "fault-test"
STRAIGHT = WheelSpeeds(left_rad_s=5.0, right_rad_s=5.0)
Open = Callable[[str], tuple[Board, Bench]]


@pytest.fixture
def driving() -> Iterator[Open]:
    """Return a function that opens a robot and drives it at 5 rad/s for one second."""
    boards = []

    def open_(options: str = "") -> tuple[Board, Bench]:
        board = Board.open(f"sim://{NAME}/board?x_m=-1&{options}", baud=500_000)
        boards.append(board)
        board.command(Command.ARM)
        bench = simulation(NAME)
        drive(board, bench, 1.0)
        return board, bench

    yield open_
    for board in boards:
        board.close()


def drive(board: Board, bench: Bench, seconds: float) -> Telemetry:
    """Command the speed at each telemetry message, whatever the board reports; return the last message."""
    until_s, last = bench.time_s + seconds, None
    while bench.time_s < until_s:
        board.set_wheel_speeds(STRAIGHT)
        for sample in board.poll(0.6):
            last = sample.telemetry
    assert last is not None
    return last


def time_to_fault_s(board: Board, bench: Bench, within_s: float) -> tuple[float, Telemetry]:
    """Drive on until the board reports a fault; return the time it took [s] and the telemetry."""
    start_s = bench.time_s
    while bench.time_s < start_s + within_s:
        telemetry = drive(board, bench, 0.02)
        if telemetry.state is State.FAULT:
            return bench.time_s - start_s, telemetry
    pytest.fail(f"no fault within {within_s} s")


@pytest.mark.parametrize("wire", ["cut", "grounded", "stuck"])
def test_broken_encoder_wire_stops_the_count(driving: Open, wire: str) -> None:
    """A single channel toggles over one edge: the count stops while the wheel turns."""
    board, bench = driving("")
    bench.fault("encoder.left.b", wire)
    before = drive(board, bench, 0.04)
    turned_rad = bench.chip.truth().wheel_rad[0]
    after = drive(board, bench, 0.1)
    assert abs(after.left_count - before.left_count) <= 2
    assert abs(bench.chip.truth().wheel_rad[0] - turned_rad) > 0.2
    assert after.right_count - before.right_count > 50


def test_repaired_wire_counts_again(driving: Open) -> None:
    board, bench = driving("")
    bench.fault("encoder.right.a", "cut")
    drive(board, bench, 0.06)
    bench.fault("encoder.right.a", "ok")
    before = drive(board, bench, 0.04)
    after = drive(board, bench, 0.1)
    assert after.right_count - before.right_count > 50


def test_dead_motor_has_no_current_and_no_torque(driving: Open) -> None:
    """The body drags this side along, slower than the other; its current is 0."""
    board, bench = driving("")
    bench.fault("motor.left", "dead")
    drive(board, bench, 0.3)
    truth = bench.chip.truth()
    assert truth.current_A[0] == 0.0
    assert truth.current_A[1] > 0.0
    assert truth.wheel_rad_s[0] < 0.95 * truth.wheel_rad_s[1]


def test_swapped_channels_count_backwards(driving: Open) -> None:
    """The wheel rolls forward, its count decreases, and the firmware reports it."""
    board, bench = driving("")
    bench.fault("encoder.left.channels", "swapped")
    before, turned_rad = drive(board, bench, 0.04), bench.chip.truth().wheel_rad[0]
    after = drive(board, bench, 0.1)
    assert bench.chip.truth().wheel_rad[0] > turned_rad + 0.2
    assert after.left_count - before.left_count < -30
    assert after.right_count - before.right_count > 50
    _, telemetry = time_to_fault_s(board, bench, 1.0)
    assert telemetry.fault is Fault.REVERSED_LEFT


def test_swapped_motor_leads_reverse_the_wheels(driving: Open) -> None:
    board, bench = driving("")
    bench.fault("motor.right", "swapped")
    took_s, telemetry = time_to_fault_s(board, bench, 1.0)
    assert telemetry.fault is Fault.REVERSED_RIGHT
    assert took_s < 0.6
    assert bench.chip.truth().wheel_rad_s[1] < -1.0


def test_shorted_motor_causes_over_current(driving: Open) -> None:
    """The bridge drives 0.1 ohm in parallel to the motors at the mean voltage, then it is off."""
    board, bench = driving("")
    bench.fault("motor.left", "shorted")
    bench.advance(bench.time_s + 0.005)
    truth = bench.chip.truth()
    duty = bench.chip.data(0xB4) / 255.0  # OCR2B
    assert truth.current_A[0] - truth.current_A[1] == pytest.approx(duty * truth.battery_V / 0.1, rel=0.3)
    assert truth.current_A[0] > 20.0
    _, telemetry = time_to_fault_s(board, bench, 1.0)
    assert telemetry.fault is Fault.OVER_CURRENT
    bench.advance(bench.time_s + 0.1)
    assert bench.chip.truth().current_A[0] == 0.0


@pytest.mark.parametrize("number", [1, 2])
def test_a_closed_switch_stops_the_motors(driving: Open, number: int) -> None:
    board, bench = driving("")
    board.command(Command.DISARM)
    board.set_parameter(f"input_{number}", 1)
    board.command(Command.ARM)
    assert drive(board, bench, 0.5).fault is Fault.NONE
    bench.fault(f"input.{number}", "closed")
    took_s, telemetry = time_to_fault_s(board, bench, 1.0)
    assert telemetry.fault is Fault[f"INPUT_{number}"]
    assert took_s < 0.15
    with pytest.raises(ThumperError, match="protecting input is active"):
        board.command(Command.CLEAR_FAULT)
    bench.fault(f"input.{number}", "ok")
    bench.advance(bench.time_s + 0.01)
    board.command(Command.CLEAR_FAULT)


def test_a_stopped_converter_stops_the_motors(driving: Open) -> None:
    """Its data register keeps the last value: the battery would look charged and the currents normal."""
    board, bench = driving("")
    bench.fault("adc", "stopped")
    took_s, telemetry = time_to_fault_s(board, bench, 1.0)
    assert telemetry.fault is Fault.ADC_STOPPED
    assert telemetry.battery_mV == 0
    assert took_s < 0.25
    bench.fault("adc", "ok")
    assert drive(board, bench, 0.3).battery_mV > 7000
    board.command(Command.CLEAR_FAULT)
    board.command(Command.ARM)
    assert drive(board, bench, 0.5).fault is Fault.NONE


def test_glitches_on_encoder_wires(driving: Open) -> None:
    """1000 pulses per second cancel out; 50 000 overlap with each other and with edges: a fault."""
    board, bench = driving("")
    bench.fault("encoder.right.glitches", 1000.0)
    before, turned = drive(board, bench, 0.04), bench.chip.truth().encoder_count[1]
    after, still = drive(board, bench, 1.0), bench.chip.truth().encoder_count[1]
    assert after.state is State.CLOSED_LOOP
    assert after.right_count - before.right_count == pytest.approx(still - turned, abs=25)
    bench.fault("encoder.right.glitches", 50_000.0)
    _, telemetry = time_to_fault_s(board, bench, 1.0)
    assert telemetry.fault is Fault.LOST_EDGES
    bench.fault("encoder.right.glitches", 0.0)
    lost = drive(board, bench, 0.1).lost_edges
    assert drive(board, bench, 0.5).lost_edges == lost


def test_blocked_wheels_draw_the_stall_current(driving: Open) -> None:
    board, bench = driving("")
    bench.fault("wheels.right", "blocked")
    drive(board, bench, 0.15)
    bench.advance(bench.time_s + 0.03)  # until the new duty takes effect
    truth = bench.chip.truth()
    assert truth.wheel_rad_s[1] == 0.0
    duty = bench.chip.data(0xB3) / 255.0  # OCR2A
    assert truth.current_A[1] == pytest.approx(3.0 * duty * truth.battery_V / 1.39, rel=0.15)


def test_slip_reduces_the_distance_of_the_body(driving: Open) -> None:
    """With slip 0.5 on both sides the body moves half as far as the wheels roll."""
    board, bench = driving("")
    bench.fault("slip.left", 0.5)
    bench.fault("slip.right", 0.5)
    start, rolled_from = bench.chip.truth().map_from_base, bench.chip.truth().wheel_rad
    drive(board, bench, 0.5)
    rolled_rad = np.mean(np.subtract(bench.chip.truth().wheel_rad, rolled_from))
    moved_m = bench.chip.truth().map_from_base.distance_m(start)
    assert moved_m == pytest.approx(0.5 * 0.062 * rolled_rad, rel=0.02)


def test_carried_robot_moves_without_wheel_counts(driving: Open) -> None:
    board, bench = driving("")
    before = drive(board, bench, 0.02)
    bench.fault("robot.carried", [1.0, 0.5, 90.0])
    after = drive(board, bench, 0.02)
    truth = bench.chip.truth().map_from_base
    assert (truth.x_m, truth.y_m, truth.theta_rad) == pytest.approx((1.0, 0.5, math.pi / 2), abs=0.05)
    tenths_s = (after.time_us - before.time_us) / 1e5
    assert after.left_count - before.left_count == pytest.approx(tenths_s * 0.5 * 1200 / math.tau, rel=0.05)


def test_line_noise_is_counted_and_tolerated(driving: Open) -> None:
    """With 3 of 1000 bytes corrupted and 2 lost, a fifth of the frames drop and none is misread."""
    board, bench = driving("")
    bench.fault("line.noise", 0.003)
    bench.fault("line.loss", 0.002)
    setpoints = set()
    last_errors = 0
    for _ in range(40):
        telemetry = drive(board, bench, 0.1)
        setpoints.add((telemetry.left_setpoint, telemetry.right_setpoint))
        last_errors = telemetry.rx_errors
        assert telemetry.state is State.CLOSED_LOOP or telemetry.fault is Fault.LINK_LOST
    assert setpoints <= {(5000, 5000), (0, 0)}
    assert last_errors > 0
    assert board.receive_errors > 0


@pytest.mark.slow
def test_losing_one_command_in_fifty_does_not_stop_the_robot(driving: Open) -> None:
    """2 of 1000 bytes are corrupted for a minute at the rate of the robot's control cycle."""
    board, bench = driving("world=hall&seed=3")
    spin = WheelSpeeds(left_rad_s=1.0, right_rad_s=-1.0)
    bench.fault("line.noise", 0.002)
    until_s = bench.time_s + 60.0
    errors = 0
    while bench.time_s < until_s:
        board.set_wheel_speeds(spin)
        for sample in board.poll(LATE_CYCLE_S):
            errors = sample.telemetry.rx_errors
            assert sample.telemetry.state is State.CLOSED_LOOP, sample.telemetry.fault
    assert errors > 10
    bench.fault("line.noise", 0.0)


def test_dead_line_stops_the_robot(driving: Open) -> None:
    """Every byte is lost: no command arrives, and after 300 ms the motors are off."""
    board, bench = driving("")
    bench.fault("line.loss", 1.0)
    board.set_wheel_speeds(STRAIGHT)
    assert board.poll(0.4) == []
    assert [bench.chip.data(address) for address in (0xB3, 0xB4)] == [0, 0]
    bench.fault("line.loss", 0.0)
    assert board.poll(0.3)[-1].telemetry.fault is Fault.LINK_LOST


def test_hanging_host_stops_the_robot(driving: Open) -> None:
    """The host hangs for a second during a read; the firmware stops without waiting for it."""
    board, bench = driving("")
    bench.fault("host.hang", 1.0)
    before_s = bench.time_s
    board.poll(0.1)
    assert bench.time_s == pytest.approx(before_s + 1.0, abs=0.05)
    telemetry = drive(board, bench, 0.05)
    assert telemetry.fault is Fault.LINK_LOST
    assert bench.chip.truth().wheel_rad_s == (0.0, 0.0)


def test_reset_while_driving_disarms_the_robot(driving: Open) -> None:
    board, bench = driving("")
    bench.fault("firmware", "reset")
    for _ in range(5):
        board.set_wheel_speeds(STRAIGHT)
        bench.advance(bench.time_s + 0.1)
    assert bench.chip.resets == 1
    assert bench.chip.truth().wheel_rad_s == (0.0, 0.0)


@pytest.mark.parametrize(("name", "value"), [("battery.charge", 0.02), ("battery.resistance", 1.2)])
def test_sagging_battery_stops_the_robot(driving: Open, name: str, value: float) -> None:
    """Empty, or old: the motor current over 1.2 ohm pulls it below 6.4 V. The motors go off."""
    board, bench = driving("charge=0.3")
    bench.fault(name, value)
    took_s, telemetry = time_to_fault_s(board, bench, 8.0)
    assert telemetry.fault is Fault.LOW_BATTERY
    assert took_s < 4.0
    drive(board, bench, 1.0)
    assert np.abs(bench.chip.truth().wheel_rad_s).max() < 0.05  # the board beeps with its motors


@pytest.mark.parametrize("device", ["board", "lidar"])
def test_unplugged_device_is_a_port_error(driving: Open, device: str) -> None:
    board, bench = driving("")
    bench.fault(device, "unplugged")
    if device == "board":
        with pytest.raises(ThumperError, match=r"port .* failed .*cable"):
            board.poll(0.1)
    bench.fault(device, "ok")
    assert drive(board, bench, 0.1).state is State.CLOSED_LOOP


def test_scenario_applies_faults_at_their_times(driving: Open, tmp_path: Path) -> None:
    scenario = tmp_path / "faults.toml"
    scenario.write_text(
        "faults = [\n"
        '  { at_s = 1.6, motor.left = "dead", slip.right = 0.5 },\n'
        "  { at_s = 0.01, robot.carried = [0.0, 0.5, 90.0] },\n]\n"
    )
    board, bench = driving(f"scenario={scenario}")
    assert bench.truth()[3, 3] == pytest.approx(math.pi / 2, abs=0.01)
    drive(board, bench, 1.7 - bench.time_s)
    assert bench.truth()[-1, 0] >= 1.6
    assert bench.chip.truth().current_A[0] == 0.0


def test_unknown_fault_lists_the_choices(driving: Open) -> None:
    _, bench = driving("")
    with pytest.raises(ThumperError, match=r"unknown fault 'engine'.*encoder\.left\.a"):
        bench.fault("engine", "off")
