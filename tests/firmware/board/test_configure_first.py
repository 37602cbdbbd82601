"""A parameter holds from the next control tick on, also if it arrives together with ARM and PWM."""

from tests.firmware.board.boot import ELF
from tests.firmware.board.wire import run_for, send
from thumper.board.framing import encode_frame
from thumper.board.messages import (
    PARAMETERS,
    Command,
    CommandRequest,
    Identify,
    Message,
    SetMotorPwm,
    SetParameter,
    SetWheelSpeeds,
)
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.instrumented_chip import InstrumentedChip
from thumper_hil.chip.preemption import Symbol, symbol
from thumper_hil.chip.robot_params import RobotParams

PORTD, FORWARD, OCR2B = 0x2B, 1 << 2, 0xB4
REVERSED, KS = (
    next(spec.index for spec in PARAMETERS if spec.name == name) for name in ("left_motor_reversed", "ks")
)
TICK_S, PWM = 0.1, 100
KS_HIGH = 6000
REQUESTS: list[Message] = [
    *[Identify()] * 5,  # their answers take four times as long, so the rest arrives in one pass
    SetParameter(index=REVERSED, value=1),
    CommandRequest(command=Command.ARM),
    SetMotorPwm(left=PWM, right=0),
    *[Identify()] * 2,
]


def run_to_tick(chip: InstrumentedChip) -> None:
    """Run until a control tick has just changed the time of its samples."""
    time_us = symbol(ELF, "samples").address
    last = chip.data(time_us)
    while chip.data(time_us) == last:
        run_for(chip, 20e-6)


def test_no_tick_drives_with_the_old_direction() -> None:
    """At each moment of the requests before a tick: they take 3 ms, answers included."""
    chip = InstrumentedChip(ELF, params=RobotParams.load(), seed=1)
    run_for(chip, 0.3)
    burst = b"".join(encode_frame(message.ID, 1, message.pack()) for message in REQUESTS)
    driven = 0
    for step in range(24):
        send(chip, CommandRequest(command=Command.DISARM))
        send(chip, SetParameter(index=REVERSED, value=0))
        run_to_tick(chip)
        run_for(chip, TICK_S - 0.2e-3 * step - 0.3e-3)
        chip.send(burst)
        run_to_tick(chip)
        run_for(chip, 50e-6)
        if chip.data(OCR2B) == PWM:
            driven += 1
            assert not chip.data(PORTD) & FORWARD, f"step {step}"
        run_for(chip, 0.11)
        assert chip.data(OCR2B) == PWM
        assert not chip.data(PORTD) & FORWARD
    assert 0 < driven < 24


def test_the_next_tick_uses_a_new_gain() -> None:
    """The main loop writes one set of constants while the tick reads the other, which then is the old one."""
    chip = InstrumentedChip(ELF, params=RobotParams.load(), seed=1)
    run_for(chip, 0.3)
    send(chip, CommandRequest(command=Command.ARM))
    pwm = []
    for step in range(24):
        send(chip, SetWheelSpeeds(left=4000, right=4000))
        run_to_tick(chip)
        run_for(chip, 50e-6)
        pwm.append(chip.data(OCR2B))
        run_for(chip, TICK_S - 20e-3)
        chip.send(encode_frame(SetParameter.ID, 1, SetParameter(index=KS, value=KS_HIGH * (step % 2)).pack()))
    assert max(pwm[13::2]) + 30 < min(pwm[12::2])


def test_the_main_loop_never_writes_the_constants_that_the_tick_reads() -> None:
    chip = InstrumentedChip(ELF, params=RobotParams.load(), seed=1)
    run_for(chip, 0.3)
    active, sets = symbol(ELF, "active_config"), symbol(ELF, "configs")
    half = sets.size // 2
    written = set()
    for step in range(2):
        chip.send(encode_frame(SetParameter.ID, 1, SetParameter(index=KS, value=KS_HIGH * (step % 2)).pack()))
        end = chip.cycle + CPU_HZ // 500
        before = contents(chip, sets)
        while chip.cycle < end:
            in_use = chip.data(active.address)
            chip.run(chip.cycle + 1)
            if (after := contents(chip, sets)) != before:
                changed = next(i for i in range(sets.size) if after[i] != before[i]) // half
                assert changed != in_use
                written.add(changed)
            before = after
    assert written == {0, 1}


def contents(chip: InstrumentedChip, variable: Symbol) -> bytes:
    """Return the bytes of a variable."""
    return bytes(chip.data(variable.address + i) for i in range(variable.size))
