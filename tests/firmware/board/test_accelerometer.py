"""The T'REX's accelerometer on the emulated chip: tilt and impact stop the driving motors."""

import math

import pytest

from tests.firmware.board.boot import BUILD
from tests.firmware.board.test_inputs import INDEX, duties, fault
from tests.firmware.board.wire import ask, run_for, send
from thumper.board.messages import (
    Ack,
    AckStatus,
    BoardModel,
    Command,
    CommandRequest,
    Fault,
    Identify,
    SetMotorPwm,
    SetParameter,
    State,
    Telemetry,
)
from thumper_hil.chip.chip_faults import FaultyChip
from thumper_hil.chip.robot_params import RobotParams

COUNT_PER_V = 51.2
HALF_G_V, IMPACT_V = 0.4, 0.8
AXIS_PERIOD_S = 0.003


def robot(board: BoardModel = BoardModel.TREX, **limits_V: float) -> FaultyChip:
    """Return a level robot with these limits."""
    folder = BUILD if board is BoardModel.TREX else BUILD / board.name.lower()
    chip = FaultyChip(folder / "thumper.elf", params=RobotParams.load(), board=board)
    run_for(chip, 0.2)
    for name, limit_V in limits_V.items():
        send(chip, SetParameter(index=INDEX[name], value=round(limit_V * COUNT_PER_V)))
    return chip


def drive(chip: FaultyChip, pwm: int, seconds: float) -> None:
    """Drive by PWM for a multiple of 0.1 s."""
    for _ in range(round(seconds / 0.1)):
        send(chip, SetMotorPwm(left=pwm, right=pwm))
        run_for(chip, 0.1)


def driving(**limits_V: float) -> FaultyChip:
    """Return a robot that drives forward with these limits."""
    chip = robot(BoardModel.TREX, **limits_V)
    send(chip, CommandRequest(command=Command.ARM))
    drive(chip, 120, 1.0)
    assert duties(chip) == [120, 120]
    return chip


@pytest.mark.parametrize("upside_down", [False, True])
def test_a_robot_on_its_side_stops_after_300_ms(upside_down: bool) -> None:
    """Up to 55 degrees it drives on, from 65 degrees on it stops. 0.4 V are half a g, 60 degrees."""
    chip = robot(tilt_limit=-HALF_G_V if upside_down else HALF_G_V)
    level_rad = math.pi if upside_down else 0.0
    chip.set_attitude(roll_rad=level_rad)
    send(chip, CommandRequest(command=Command.ARM))
    drive(chip, 120, 1.0)
    chip.set_attitude(pitch_rad=math.radians(55.0), roll_rad=level_rad)
    drive(chip, 120, 0.5)
    assert duties(chip) == [120, 120]
    chip.set_attitude(roll_rad=level_rad + math.radians(65.0))
    drive(chip, 120, 0.2)
    assert duties(chip) == [120, 120]
    drive(chip, 120, 0.2)
    assert duties(chip) == [0, 0]
    assert fault(chip) == (State.FAULT, Fault.TILTED)


def test_a_flood_of_requests_hardly_delays_the_tilt() -> None:
    """The answers need twice the line's bytes: the main loop waits for it and misses every second reading."""
    chip = driving(tilt_limit=HALF_G_V)
    chip.set_attitude(roll_rad=math.radians(65.0))
    start_s = chip.time_s
    for millisecond in range(600):
        if millisecond % 50 == 0:
            send(chip, SetMotorPwm(left=120, right=120))
        for _ in range(3):
            send(chip, Identify())
        run_for(chip, 1e-3)
        if duties(chip) == [0, 0]:
            break
    assert 0.28 < chip.time_s - start_s < 0.55
    assert fault(chip) == (State.FAULT, Fault.TILTED)


@pytest.mark.parametrize("limit_V", [IMPACT_V, 0.0])
def test_a_collision_stops_the_motors(limit_V: float) -> None:
    """Within two readings of all axes; without a limit it drives on."""
    chip = driving(impact_limit=limit_V)
    chip.hold(1.0, 0.0)
    run_for(chip, 3 * AXIS_PERIOD_S)
    assert duties(chip) == ([0, 0] if limit_V else [120, 120])
    assert fault(chip)[1] is (Fault.IMPACT if limit_V else Fault.NONE)


def test_a_push_from_the_side_stops_the_motors() -> None:
    """A jump to 65 degrees of roll: 0.73 V on y, 0.46 V on z."""
    chip = driving(impact_limit=0.6)
    chip.set_attitude(roll_rad=math.radians(65.0))
    run_for(chip, 3 * AXIS_PERIOD_S)
    assert duties(chip) == [0, 0]
    assert fault(chip) == (State.FAULT, Fault.IMPACT)


@pytest.mark.parametrize("phase_ms", range(3))
def test_an_old_reading_is_no_impact(phase_ms: int) -> None:
    """It is not read while both limits are 0. Then somebody turns the robot over.

    With a limit that x or y alone exceeds: no axis may be old.
    """
    chip = robot(impact_limit=HALF_G_V)
    run_for(chip, 0.05 + 1e-3 * phase_ms)
    send(chip, SetParameter(index=INDEX["impact_limit"], value=0))
    run_for(chip, 0.01)
    chip.set_attitude(pitch_rad=1.0, roll_rad=2.0)
    send(chip, SetParameter(index=INDEX["impact_limit"], value=round(HALF_G_V * COUNT_PER_V)))
    send(chip, CommandRequest(command=Command.ARM))
    send(chip, SetMotorPwm(left=120, right=120))
    run_for(chip, 0.02)
    assert fault(chip)[1] is Fault.NONE


def test_starts_stops_and_turns_are_no_impact() -> None:
    chip = driving(impact_limit=IMPACT_V, tilt_limit=HALF_G_V)
    for left, right in [(255, 255), (-255, -255), (0, 0), (255, -255), (0, 0)]:
        for _ in range(4):
            send(chip, SetMotorPwm(left=left, right=right))
            run_for(chip, 0.1)
    assert fault(chip)[1] is Fault.NONE


def test_battery_and_currents_stay_the_same() -> None:
    """Every second conversion is the accelerometer's."""
    readings = []
    for limits in ({}, {"tilt_limit": HALF_G_V}):
        chip = driving(**limits)
        drive(chip, 120, 1.0)
        frame = ask(chip, SetMotorPwm(left=120, right=120), Telemetry, wait_s=0.12)
        assert frame is not None
        last = Telemetry.unpack(frame.payload)
        readings.append((last.battery_mV, last.left_current_mA, last.right_current_mA))
        current_mA = [1000 * current_A for current_A in chip.truth().current_A]
        assert readings[-1][1:] == pytest.approx(current_mA, rel=0.2, abs=150)
    assert readings[0] == pytest.approx(readings[1], rel=0.02, abs=60)


def test_a_stopped_converter_is_noticed() -> None:
    chip = driving(tilt_limit=HALF_G_V)
    chip.stop_adc(stopped=True)
    drive(chip, 120, 0.1)
    assert fault(chip)[1] is Fault.ADC_STOPPED


def test_a_board_without_it_refuses() -> None:
    chip = robot(BoardModel.NANO)
    for name in ("tilt_limit", "impact_limit"):
        for value, status in ((10, AckStatus.NO_ACCELEROMETER), (0, AckStatus.OK)):
            frame = ask(chip, SetParameter(index=INDEX[name], value=value), Ack)
            assert frame is not None
            assert Ack.unpack(frame.payload).status is status
