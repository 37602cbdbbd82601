"""Directions and PWM frequency as parameters, on the emulated chip with the simulated robot."""

import pytest

from tests.firmware.board.boot import ELF
from tests.firmware.board.wire import frames, run_for, send
from thumper.board.messages import (
    PARAMETERS,
    Command,
    CommandRequest,
    Fault,
    SetMotorPwm,
    SetParameter,
    SetWheelSpeeds,
    State,
    Telemetry,
)
from thumper_hil.chip.instrumented_chip import InstrumentedChip
from thumper_hil.chip.robot_params import RobotParams

TCCR2B = 0xB1
TICK_S = 0.1
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
    """Plus at most one control tick, because the monitor counts whole ticks."""
    chip = robot(**{name: 1})
    start_s = chip.time_s
    last: list[Telemetry] = []
    while not last or last[-1].fault is Fault.NONE:
        send(chip, SetMotorPwm(left=pwm[0], right=pwm[1]))
        run_for(chip, 0.02)
        last = telemetry(chip) or last
        assert chip.time_s < start_s + 0.3 + 2 * TICK_S + 0.02
    side = name.split("_", maxsplit=1)[0].upper()
    assert last[-1].fault is Fault[f"REVERSED_{side}"]


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
