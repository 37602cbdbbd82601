"""A motor turns round at PWM 0: never in a new direction under the old duty, traced on the emulated chip."""

import pytest

from tests.firmware.boot import ELF
from tests.firmware.wire import run_for, send
from thumper.link.messages import Command, CommandRequest, SetMotorPwm
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.lab import LabChip
from thumper_hil.parts.params import RobotParams

PWM_PERIOD_S = 510 * 256 / CPU_HZ
TCCR2A, OCR2A, OCR2B = 0xB0, 0xB3, 0xB4
PORTB, PORTD = 0x25, 0x2B
STEP_S = 20e-6

# Port and bit of the direction pin, bit of the PWM output in TCCR2A, compare register.
SIDES = {"left": (PORTD, 2, 5, OCR2B), "right": (PORTB, 2, 7, OCR2A)}


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize(("before", "after"), [(200, -150), (-200, 150), (200, -1)])
def test_a_turning_motor_rests_first(side: str, before: int, after: int) -> None:
    port, direction_bit, output_bit, compare = SIDES[side]
    chip = LabChip(ELF, params=RobotParams.load())
    run_for(chip, 0.2)
    send(chip, CommandRequest(command=Command.ARM))
    for _ in range(3):
        send(chip, SetMotorPwm(left=before, right=before))
        run_for(chip, 0.1)
    assert chip.data(compare) == abs(before)
    assert chip.data(port) >> direction_bit & 1 == (before > 0)

    send(
        chip,
        SetMotorPwm(left=after if side == "left" else before, right=after if side == "right" else before),
    )
    turned_s = None
    on_s = None
    for _ in range(round(0.15 / STEP_S)):
        run_for(chip, STEP_S)
        driven = chip.data(TCCR2A) >> output_bit & 1
        if turned_s is None and chip.data(port) >> direction_bit & 1 == (after > 0):
            turned_s = chip.time_s
        if turned_s is None:
            assert chip.data(compare) == abs(before) or not driven, "no new duty in the old direction"
        elif on_s is None and driven:
            on_s = chip.time_s
            assert chip.data(compare) == abs(after)
        other = OCR2A if side == "left" else OCR2B
        assert chip.data(other) == abs(before), "the other motor goes on"
    assert turned_s is not None
    assert on_s is not None
    assert PWM_PERIOD_S <= on_s - turned_s <= 0.012, "the old duty has gone when the timer drives again"


def test_at_zero_a_motor_keeps_its_way() -> None:
    """At PWM 0 the direction stays: a wheel that dithers about zero is not turned round each time."""
    chip = LabChip(ELF, params=RobotParams.load())
    run_for(chip, 0.2)
    send(chip, CommandRequest(command=Command.ARM))
    for pwm in (-100, 0, -100, 0):
        send(chip, SetMotorPwm(left=pwm, right=pwm))
        run_for(chip, 0.15)
        send(chip, SetMotorPwm(left=pwm, right=pwm))
        run_for(chip, 0.05)
        assert chip.data(PORTD) >> 2 & 1 == 0
        assert chip.data(OCR2B) == -pwm
