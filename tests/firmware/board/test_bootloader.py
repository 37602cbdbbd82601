"""Stock boot loader and watchdog on the emulated chip: the effects of a hang at any place."""

import pytest

from tests.firmware.board.boot import ELF, chip_with_program
from tests.firmware.board.wire import frames, identity, run_for, send
from thumper.board.messages import (
    Command,
    CommandRequest,
    Fault,
    ResetCause,
    SetWheelSpeeds,
    State,
    Telemetry,
)
from thumper_hil.chip.instrumented_chip import InstrumentedChip
from thumper_hil.chip.robot_params import RobotParams

BOOT_S = 1.33
"""From the reset to the start of the program, with ATmegaBOOT."""

WATCHDOG_S = 0.26
"""Nominally 250 ms; 32768 cycles of its 128 kHz oscillator."""

OCR2A, OCR2B = 0xB3, 0xB4
DDRB, DDRD = 0x24, 0x2A
PORTB, PORTD, MCUSR, TCCR2A = 0x25, 0x2B, 0x54, 0xB0
MOTORS_B, MOTORS_D, FORWARD = 0b1110, 0b11100, 1 << 2
SET_AT_START = {
    **dict.fromkeys((DDRB, PORTB), 0b11_1110),  # motor and encoder pins
    **dict.fromkeys((DDRD, PORTD), 0b111_1100),
    **dict.fromkeys((0x44, 0x45, 0x47, 0x48, 0x6E), 0xFF),  # TCCR0A, TCCR0B, OCR0A, OCR0B, TIMSK0
    **dict.fromkeys((0x80, 0x81, 0x88, 0x89, 0x6F), 0xFF),  # TCCR1A, TCCR1B, OCR1A, TIMSK1
    **dict.fromkeys((TCCR2A, 0xB1, OCR2A, OCR2B), 0xFF),  # and TCCR2B
    **dict.fromkeys((0x68, 0x6B, 0x6D), 0xFF),  # PCICR, PCMSK0, PCMSK2
    **dict.fromkeys((0xC1, 0xC2, 0xC4, 0xC5), 0xFC),  # UCSR0B, UCSR0C, UBRR0
    **dict.fromkeys((0x4A, 0x4B), 0xFF),  # GPIOR1, GPIOR2: indices of the serial port's rings
    0x27: 1 << 5,  # DDRC: the gyroscope's SCL
    0xBC: 0b0100_0101,  # TWCR
    0x53: 0b1110,  # SMCR: the sleep mode
}
"""Registers and their bits that the start must set."""
CYCLE_S = 1.0 / 16e6
JMP_0 = bytes((0x0C, 0x94, 0x00, 0x00))
SLEEP = bytes((0x88, 0x95))
RETI = bytes((0x18, 0x95))
TICK_S = 0.1
SEI = bytes((0x78, 0x94))
PCINT2, TIMER0_COMPA = 5, 14
"""The left encoder's interrupt runs with interrupts off; the millisecond's allows nesting."""


def driving_robot() -> InstrumentedChip:
    """Return a robot with the boot loader that has driven for a second."""
    chip = chip_with_program(ELF, params=RobotParams.load())
    run_for(chip, BOOT_S + 0.2)
    send(chip, CommandRequest(command=Command.ARM))
    for _ in range(10):
        send(chip, SetWheelSpeeds(left=6000, right=6000))
        run_for(chip, 0.1)
    assert min(chip.truth().wheel_rad_s) > 4.0
    return chip


def test_the_boot_loader_drives_only_its_led_pin() -> None:
    """Its LED is on D13, so an encoder wire on that pin needs the 1 kohm of docs/explanation/firmware.md."""
    chip = chip_with_program(ELF)
    driven = set()
    for _ in range(round(0.9 * BOOT_S / 0.001)):
        run_for(chip, 0.001)
        driven.add((chip.data(DDRB), chip.data(DDRD)))
    assert driven <= {(0, 0), (1 << 5, 0)}
    assert (1 << 5, 0) in driven


def handler(chip: InstrumentedChip, vector: int) -> int:
    """Return the start of an interrupt handler: the target of the `jmp` or `rjmp` in the vector table."""
    word = int.from_bytes(chip.read_flash(4 * vector, 2), "little")
    if word == 0x940C:
        return 2 * int.from_bytes(chip.read_flash(4 * vector + 2, 2), "little")
    assert word >> 12 == 0xC
    offset = word & 0xFFF
    return 4 * vector + 2 + 2 * (offset - 0x1000 if offset & 0x800 else offset)


def find(chip: InstrumentedChip, instruction: bytes, start: int = 0) -> int:
    """Return the first address of an instruction in the flash."""
    address = chip.read_flash(start, 0x4000).index(instruction) + start
    assert address % 2 == 0
    return address


def motors_off_after(chip: InstrumentedChip, limit_s: float) -> float:
    """Run until both motors have no voltage, in steps of 1 ms; return the elapsed time."""
    start_s = chip.time_s
    while chip.time_s < start_s + limit_s:
        run_for(chip, 0.001)
        pulsed = chip.data(OCR2A) or chip.data(OCR2B)
        connected = chip.data(DDRB) & 1 << 3 or chip.data(DDRD) & 1 << 3
        if not (pulsed and connected):
            return chip.time_s - start_s
    raise AssertionError(f"the motors still run after {limit_s} s")


def last_telemetry(chip: InstrumentedChip) -> Telemetry:
    """Return the last telemetry message of the next 0.2 s."""
    chip.receive(chip.available)
    run_for(chip, 0.2)
    found = [frame for frame in frames(chip) if frame.message_id == Telemetry.ID]
    return Telemetry.unpack(found[-1].payload)


def test_the_boot_loader_starts_the_firmware() -> None:
    """It takes a little more than a second after a reset, and the firmware still reads the reset cause."""
    chip = chip_with_program(ELF)
    run_for(chip, 0.9 * BOOT_S)
    assert identity(chip) is None
    run_for(chip, 0.3 * BOOT_S)
    answer = identity(chip)
    assert answer is not None
    assert answer.reset_cause is ResetCause.EXTERNAL
    assert chip.resets == 1


@pytest.mark.parametrize("where", ["main loop", "interrupt"])
def test_a_hang_with_interrupts_on_is_recovered(where: str) -> None:
    """The watchdog interrupt stops the motors and restarts the program without the boot loader."""
    chip = driving_robot()
    if where == "main loop":
        address = find(chip, SLEEP)  # where it waits for work
    else:
        start = handler(chip, TIMER0_COMPA)
        assert chip.read_flash(start, 2) == SEI
        address = start + 2
    instruction = chip.read_flash(address, 2)
    chip.hang_at(address)
    assert motors_off_after(chip, 1.0) <= WATCHDOG_S + 0.01
    chip.write_flash(address, instruction)  # a bug that occurs once
    run_for(chip, 0.1)
    assert chip.resets == 1  # the initial one: no reset since, so no boot loader
    answer = identity(chip)
    assert answer is not None
    assert answer.reset_cause is ResetCause.WATCHDOG
    telemetry = last_telemetry(chip)
    assert (telemetry.state, telemetry.fault) == (State.FAULT, Fault.WATCHDOG)
    run_for(chip, 1.0)
    assert chip.truth().wheel_rad_s == (0.0, 0.0)


def test_the_watchdog_takes_the_motor_pins_from_the_timer_at_once() -> None:
    """The timer would drive them for up to a PWM period more, or for ever if the restart hung, too."""
    chip = driving_robot()
    chip.hang_at(find(chip, SLEEP))
    run_for(chip, 0.8 * WATCHDOG_S)
    start_s = chip.time_s
    while chip.data(TCCR2A) and chip.time_s < start_s + 1.0:
        run_for(chip, 50 * CYCLE_S)
    assert min(chip.data(OCR2A), chip.data(OCR2B)) > 0, "before the restart touches the timer"
    run_for(chip, 20 * CYCLE_S)
    assert (chip.data(PORTB) & MOTORS_B, chip.data(PORTD) & MOTORS_D) == (0, 0)
    assert min(chip.data(OCR2A), chip.data(OCR2B)) > 0, "before the restart touches the timer"
    while not chip.data(TCCR2A):
        run_for(chip, 50 * CYCLE_S)
    assert (chip.data(OCR2A), chip.data(OCR2B)) == (0, 0), "the timer gets them back without a duty"


def test_a_restart_is_told_once() -> None:
    """A boot loader that clears the reset flags must not repeat WATCHDOG at every later reset."""
    chip = driving_robot()
    address = find(chip, SLEEP)
    code = chip.read_flash(address, len(JMP_0))
    chip.hang_at(address)
    motors_off_after(chip, 1.0)
    chip.write_flash(address, code)
    run_for(chip, 0.2)
    chip.write_flash(address, JMP_0)  # as such a boot loader: the flags are clear
    run_for(chip, 0.01)
    assert chip.data(MCUSR) == 0
    chip.write_flash(address, code)
    run_for(chip, 0.02)
    answer = identity(chip)
    assert answer is not None
    assert answer.reset_cause is ResetCause.UNKNOWN


def test_a_jump_to_the_start_releases_brakes_and_motors() -> None:
    """As a wild jump does, while a tone or a brake holds the pins high."""
    chip = driving_robot()
    chip.write_flash(find(chip, SLEEP), JMP_0)
    chip.poke(PORTB, chip.data(PORTB) | MOTORS_B)
    chip.poke(PORTD, chip.data(PORTD) | MOTORS_D)
    run_for(chip, 0.02)
    assert (chip.data(PORTB) & MOTORS_B, chip.data(PORTD) & MOTORS_D) == (FORWARD, FORWARD)


def test_a_restart_sets_every_register_as_a_reset_does() -> None:
    """A jump to address 0 resets no register: whatever they hold, the start must set them."""
    chip = InstrumentedChip(ELF)
    run_for(chip, 0.02)
    expected = {register: chip.data(register) & bits for register, bits in SET_AT_START.items()}
    address = find(chip, SLEEP)
    code = chip.read_flash(address, len(JMP_0))
    chip.write_flash(address, JMP_0)  # it starts again and again
    run_for(chip, 0.002)
    for register, bits in SET_AT_START.items():
        chip.poke(register, chip.data(register) ^ bits)
    run_for(chip, 0.01)
    chip.write_flash(address, code)
    run_for(chip, 0.01)
    assert {register: chip.data(register) & bits for register, bits in SET_AT_START.items()} == expected
    assert identity(chip) is not None


def test_a_permanent_hang_keeps_the_motors_off() -> None:
    """After each restart it hangs again at once: four times per second, for ever, with the motors off."""
    chip = driving_robot()
    chip.hang_at(find(chip, SLEEP))
    motors_off_after(chip, 1.0)
    run_for(chip, 2.0)
    assert chip.truth().wheel_rad_s == (0.0, 0.0)
    assert [chip.data(address) for address in (OCR2A, OCR2B)] == [0, 0]


def test_a_dead_millisecond_timer_is_noticed() -> None:
    """Without it the link would never time out, so ticks alone must not reset the watchdog."""
    chip = driving_robot()
    vector = chip.read_flash(4 * TIMER0_COMPA, 2)
    chip.write_flash(4 * TIMER0_COMPA, RETI)
    assert motors_off_after(chip, 1.0) <= WATCHDOG_S + TICK_S + 0.01
    chip.write_flash(4 * TIMER0_COMPA, vector)
    run_for(chip, 0.2)
    telemetry = last_telemetry(chip)
    assert (telemetry.state, telemetry.fault) == (State.FAULT, Fault.WATCHDOG)


@pytest.mark.parametrize("bootloader", [False, True])
def test_a_latched_fault_outlasts_a_reset(bootloader: bool) -> None:
    """A reset, as opening the port causes, keeps it. Only CLEAR_FAULT clears it for good."""
    chip = chip_with_program(ELF) if bootloader else InstrumentedChip(ELF, params=RobotParams.load())
    run_for(chip, BOOT_S + 0.3)
    send(chip, CommandRequest(command=Command.E_STOP))
    run_for(chip, 0.1)
    for _ in range(2):
        chip.reset()
        run_for(chip, BOOT_S + 0.1)
        telemetry = last_telemetry(chip)
        assert (telemetry.state, telemetry.fault) == (State.FAULT, Fault.E_STOP)
    answer = identity(chip)
    assert answer is not None
    assert answer.reset_cause is ResetCause.EXTERNAL
    if bootloader:
        return  # no robot, so no battery, and clearing is refused
    send(chip, CommandRequest(command=Command.CLEAR_FAULT))
    run_for(chip, 0.1)
    chip.reset()
    run_for(chip, BOOT_S + 0.1)
    assert last_telemetry(chip).state is State.DISARMED


def test_a_hang_with_interrupts_off_ends_safe_but_dead() -> None:
    """The second time-out resets the chip. The stock boot loader then loops for ever, with every pin an
    input.

    Only switching the power off and on helps: it clears the watchdog's flag.
    """
    chip = driving_robot()
    chip.hang_at(handler(chip, PCINT2))
    assert motors_off_after(chip, 1.0) <= 2 * WATCHDOG_S + 0.01
    resets = chip.resets
    run_for(chip, 2.0)
    assert chip.resets - resets > 50
    assert identity(chip) is None
    assert chip.truth().wheel_rad_s == (0.0, 0.0)
    assert chip.data(DDRB) & 0b1110 == 0
    assert chip.data(DDRD) & 0b11100 == 0
