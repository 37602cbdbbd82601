"""Directions and PWM frequency as parameters, on the emulated chip with the simulated robot."""

import pytest

from tests.firmware.board.boot import BUILD, ELF
from tests.firmware.board.wire import ask, first_fault, frames, run_for, send
from thumper.board.messages import (
    PARAMETERS,
    Ack,
    AckStatus,
    BoardModel,
    Command,
    CommandRequest,
    Fault,
    SetMotorPwm,
    SetParameter,
    SetWheelSpeeds,
    State,
    Telemetry,
)
from thumper_hil.chip.chip_faults import FaultyChip
from thumper_hil.chip.instrumented_chip import InstrumentedChip
from thumper_hil.chip.robot_params import RobotParams

TCCR2B = 0xB1
INDEX = {spec.name: spec.index for spec in PARAMETERS}
DIRECTIONS = [f"{side}_{part}_reversed" for part in ("motor", "encoder") for side in ("left", "right")]


def robot(**parameters: int) -> InstrumentedChip:
    """Return an armed robot with these parameters."""
    chip = InstrumentedChip(ELF, params=RobotParams.load(), seed=1)
    run_for(chip, 0.3)
    for name, value in parameters.items():
        send(chip, SetParameter(index=INDEX[name], value=value))
    send(chip, CommandRequest(command=Command.ARM))
    run_for(chip, 0.05)
    return chip


def telemetry(chip: InstrumentedChip) -> list[Telemetry]:
    """Return all telemetry that has arrived."""
    return [Telemetry.unpack(frame.payload) for frame in frames(chip) if frame.message_id == Telemetry.ID]


@pytest.mark.parametrize("pwm", [(130, 130), (-130, -130), (130, -130), (-200, 200)])
@pytest.mark.parametrize("name", DIRECTIONS)
def test_a_wrong_direction_is_a_named_fault_within_300_ms_of_pwm(name: str, pwm: tuple[int, int]) -> None:
    chip = robot(**{name: 1})
    for _ in range(40):
        send(chip, SetMotorPwm(left=pwm[0], right=pwm[1]))
        run_for(chip, 0.02)
    fault, after_us = first_fault(telemetry(chip))
    side = name.split("_", maxsplit=1)[0].upper()
    assert fault is Fault[f"REVERSED_{side}"]
    assert after_us <= 300_000


@pytest.mark.parametrize("side", ["left", "right"])
def test_motor_and_encoder_reversed_together_drive_the_other_way(side: str) -> None:
    """As on a robot whose side is mounted mirrored."""
    chip = robot(**{f"{side}_motor_reversed": 1, f"{side}_encoder_reversed": 1})
    for _ in range(20):
        send(chip, SetWheelSpeeds(left=4000, right=4000))
        run_for(chip, 0.1)
    last = telemetry(chip)[-1]
    assert last.state is State.CLOSED_LOOP
    assert (last.left_speed, last.right_speed) == pytest.approx((4000, 4000), abs=300)
    signs = {"left": (-1, 1), "right": (1, -1)}[side]
    assert chip.truth().wheel_rad_s == pytest.approx((4.0 * signs[0], 4.0 * signs[1]), abs=0.4)


@pytest.mark.parametrize(
    ("frequency_Hz", "select"),
    [(122, 6), (244, 6), (245, 5), (490, 4), (980, 3), (3922, 2), (31_372, 2), (31_373, 1)],
)
def test_the_pwm_frequency_selects_the_timer_clock(frequency_Hz: int, select: int) -> None:
    chip = robot(pwm_frequency=frequency_Hz)
    assert chip.data(TCCR2B) == select
    for _ in range(10):
        send(chip, SetWheelSpeeds(left=4000, right=4000))
        run_for(chip, 0.1)
    assert telemetry(chip)[-1].state is State.CLOSED_LOOP
    assert min(chip.truth().wheel_rad_s) > 3.0


def test_the_counts_per_revolution_scale_the_speed() -> None:
    chip = robot(counts_per_rev=600)
    for _ in range(20):
        send(chip, SetWheelSpeeds(left=4000, right=4000))
        run_for(chip, 0.1)
    assert chip.truth().wheel_rad_s == pytest.approx((2.0, 2.0), abs=0.2)


@pytest.mark.parametrize("at_a4", [0, 1])
def test_motor_currents_of_an_uno_are_read_at_a4_and_a5(at_a4: int) -> None:
    """It has no A6 and A7. Without the parameter the missing sensors read -25 A."""
    chip = FaultyChip(
        BUILD / "nano" / "thumper.elf", params=RobotParams.load(), board=BoardModel.NANO, seed=1
    )
    chip.move_currents(left_channel=4)
    run_for(chip, 0.3)
    send(chip, SetParameter(index=INDEX["currents_at_a4"], value=at_a4))
    run_for(chip, 0.2)
    send(chip, CommandRequest(command=Command.ARM))
    seen: list[Telemetry] = []
    for _ in range(20):
        send(chip, SetWheelSpeeds(left=4000, right=2000))
        run_for(chip, 0.1)
        seen += telemetry(chip)
    if not at_a4:
        assert seen[-1].fault is Fault.OVER_CURRENT
        return
    assert seen[-1].fault is Fault.NONE
    driven = [(t.left_current_mA, t.right_current_mA) for t in seen[-5:]]
    assert sum(left for left, _ in driven) > sum(right for _, right in driven)
    assert driven[-1][0] == pytest.approx(1000 * chip.truth().current_A[0], abs=400)


def test_gyroscope_and_currents_at_a4_exclude_each_other() -> None:
    chip = robot()
    send(chip, CommandRequest(command=Command.DISARM))

    def status(name: str, value: int) -> AckStatus:
        frame = ask(chip, SetParameter(index=INDEX[name], value=value), Ack)
        assert frame is not None
        return Ack.unpack(frame.payload).status

    for first, second in (("gyroscope", "currents_at_a4"), ("currents_at_a4", "gyroscope")):
        assert status(first, 1) is AckStatus.OK
        assert status(second, 1) is AckStatus.PINS_IN_USE
        assert status(second, 0) is AckStatus.OK
        assert status(first, 0) is AckStatus.OK


@pytest.mark.parametrize("pwm", [(110, 0), (0, 110), (-110, 0), (130, -105)])
@pytest.mark.parametrize("board", [BoardModel.TREX, BoardModel.NANO], ids=lambda board: board.name.lower())
def test_left_is_left_in_every_field(board: BoardModel, pwm: tuple[int, int]) -> None:
    """Count, speed, PWM and current of each side are those of the true wheel, in its unit."""
    folder = BUILD if board is BoardModel.TREX else BUILD / "nano"
    chip = InstrumentedChip(folder / "thumper.elf", params=RobotParams.load(), board=board, seed=1)
    run_for(chip, 0.3)
    send(chip, CommandRequest(command=Command.ARM))
    for _ in range(40):
        send(chip, SetMotorPwm(left=pwm[0], right=pwm[1]))
        run_for(chip, 0.05)
    last, truth = telemetry(chip)[-1], chip.truth()
    assert (last.left_pwm, last.right_pwm) == pwm
    sides = (
        (last.left_count, last.left_speed, last.left_current_mA),
        (last.right_count, last.right_speed, last.right_current_mA),
    )
    for side, (count, speed_mrad_s, current_mA) in enumerate(sides):
        # The telemetry is up to a control tick old.
        age_counts = 0.11 * abs(truth.wheel_rad_s[side]) * 1200 / 6.2832 + 3
        assert abs(count - truth.encoder_count[side]) <= age_counts
        assert speed_mrad_s == pytest.approx(1000 * truth.wheel_rad_s[side], abs=250)
        assert current_mA == pytest.approx(1000 * truth.current_A[side], abs=450)
    assert max(abs(count) for count, _, _ in sides) > 50
    assert abs(sides[0][0] - sides[1][0]) > 30, "otherwise an exchange would not show"
