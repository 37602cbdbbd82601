"""Registers and order of the start, and stops that must not wait for the next control tick."""

import pytest

from tests.firmware.board.boot import ELF
from tests.firmware.board.wire import frames, identity, run_for, send
from thumper.board.framing import encode_frame
from thumper.board.messages import (
    SCHEMA_HASH,
    BoardModel,
    Command,
    CommandRequest,
    Fault,
    Identify,
    ResetCause,
    SetMotorPwm,
    SetParameter,
    SetWheelSpeeds,
    State,
    Telemetry,
)
from thumper.board.parameters import parameter_named
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.chip_faults import FaultyChip
from thumper_hil.chip.instrumented_chip import EdgeSource, InstrumentedChip
from thumper_hil.chip.preemption import symbol
from thumper_hil.chip.robot_params import RobotParams
from thumper_hil.chip.wiring import ENCODERS

PORTB, PORTD, DDRB, DDRD = 0x25, 0x2B, 0x24, 0x2A
TIMSK0 = 0x6E
TCCR2A, TCCR2B, OCR2A, OCR2B = 0xB0, 0xB1, 0xB3, 0xB4
ADCSRA, ADMUX = 0x7A, 0x7C
MCUSR, PORF, BORF, WDRF = 0x54, 1 << 0, 1 << 2, 1 << 3
WDTCSR, WDE = 0x60, 1 << 3
GPIOR1, GPIOR2, UCSR0C = 0x4A, 0x4B, 0xC2
MOTORS_B, MOTORS_D = 0b1110, 0b11100
ENCODER_B, ENCODER_D = 0b11_0000, 0b110_0000
MILLISECOND_S, STEP_S = 0.001, 20e-6
NOINIT = range(0x100, 0x8FC)
TICK_READS_WITHIN = 1200
"""Cycles before the tick stores its time in which it reads the counts."""


def telemetry(chip: InstrumentedChip, seconds: float = 0.12) -> Telemetry:
    """Return the last telemetry message of the next `seconds`."""
    chip.receive(chip.available)
    run_for(chip, seconds)
    return Telemetry.unpack([f for f in frames(chip) if f.message_id == Telemetry.ID][-1].payload)


def armed(pwm: int = 0) -> InstrumentedChip:
    """Return an armed robot that drives with this PWM."""
    chip = InstrumentedChip(ELF, params=RobotParams.load())
    run_for(chip, 0.2)
    send(chip, CommandRequest(command=Command.ARM))
    for _ in range(4):
        send(chip, SetMotorPwm(left=pwm, right=pwm) if pwm else SetWheelSpeeds(left=0, right=0))
        run_for(chip, 0.1)
    return chip


def test_scratch_registers_that_a_boot_loader_has_used_do_not_disturb_the_link() -> None:
    """They are indices of the ring buffers, and a boot loader jumps to the program without a reset."""
    sent = []
    for index in (0, 9):
        chip = InstrumentedChip(ELF)
        chip.poke(GPIOR1, index)
        chip.poke(GPIOR2, index)
        run_for(chip, 0.15)
        sent.append(chip.receive(chip.available))
        assert identity(chip) is not None
    assert sent[0] == sent[1]


def test_the_serial_format_is_8n1() -> None:
    chip = InstrumentedChip(ELF)
    chip.poke(UCSR0C, 0)
    run_for(chip, 0.01)
    assert chip.data(UCSR0C) == 0b110


def test_encoder_inputs_have_pull_ups_and_motor_outputs_are_low_until_driven() -> None:
    chip = InstrumentedChip(ELF)
    run_for(chip, 0.01)
    assert chip.data(DDRB) & (MOTORS_B | ENCODER_B) == MOTORS_B
    assert chip.data(DDRD) & (MOTORS_D | ENCODER_D) == MOTORS_D
    assert chip.data(PORTB) & (MOTORS_B | ENCODER_B) == ENCODER_B | 1 << 2  # forward, brake off
    assert chip.data(PORTD) & (MOTORS_D | ENCODER_D) == ENCODER_D | 1 << 2
    assert [chip.data(address) for address in (OCR2A, OCR2B)] == [0, 0]
    assert (chip.data(TCCR2A), chip.data(TCCR2B)) == (0b1010_0001, 0b110)


def test_the_converter_runs_at_125_kHz_and_measures_against_its_supply() -> None:
    """The simulated converter is as exact at any clock, and its reference pin has 5 V, too."""
    chip = InstrumentedChip(ELF, params=RobotParams.load())
    run_for(chip, 0.1)
    send(chip, SetParameter(index=parameter_named("tilt_limit").index, value=1))  # it converts axes, too
    channels = set()
    for _ in range(200):
        run_for(chip, 1e-4)
        assert chip.data(ADCSRA) & 0b111 == 0b111  # the clock by 128
        assert chip.data(ADMUX) >> 6 == 0b01  # AVCC
        channels.add(chip.data(ADMUX) & 0b1111)
    assert channels == {0, 1, 2, 3, 6, 7}


def test_the_first_edge_after_the_start_counts() -> None:
    """The decoder starts with the level of its pins: both encoders rest at A, B high."""
    chip = InstrumentedChip(ELF)
    for pins in ENCODERS[BoardModel.TREX]:
        with chip.edges(pins) as source:
            _to_high(chip, source)
    chip.reset()
    run_for(chip, 0.01)
    with chip.edges(ENCODERS[BoardModel.TREX][0]) as left:
        run_for(chip, 0.001)
        before = telemetry(chip)
        left.start(delay_cycles=100, interval_cycles=1000, count=1)
        after = telemetry(chip)
    assert after.left_count - before.left_count == 1
    assert after.lost_edges == before.lost_edges


@pytest.mark.parametrize("wheel", [0, 1])
@pytest.mark.parametrize("phase", [1, 2, 3])
def test_the_decoder_starts_with_the_level_of_its_pins(wheel: int, phase: int) -> None:
    """Else the second edge looks like two at once, and is lost."""
    chip = InstrumentedChip(ELF)
    with chip.edges(ENCODERS[BoardModel.TREX][wheel]) as source:
        source.start(delay_cycles=1, interval_cycles=2, count=phase)  # long before the firmware reads them
        run_for(chip, 0.05)
        source.start(delay_cycles=100, interval_cycles=1000, count=1)
        last = telemetry(chip)
    assert (last.left_count, last.right_count)[wheel] == 1
    assert last.lost_edges == 0


@pytest.mark.parametrize("wheel", [0, 1])
def test_two_edges_at_once_are_reported_as_lost(wheel: int) -> None:
    chip = InstrumentedChip(ELF)
    with chip.edges(ENCODERS[BoardModel.TREX][wheel]) as source:
        run_for(chip, 0.01)
        source.start(delay_cycles=100, interval_cycles=2, count=2)
        assert telemetry(chip).lost_edges == 1


def _to_high(chip: InstrumentedChip, source: EdgeSource) -> None:
    source.start(delay_cycles=10, interval_cycles=100, count=2)
    run_for(chip, 0.001)


@pytest.mark.parametrize("command", [Command.DISARM, Command.E_STOP])
def test_a_stop_command_does_not_wait_for_the_control_tick(command: Command) -> None:
    chip = armed(pwm=100)
    run_for(chip, 0.02)
    assert chip.data(OCR2A) == chip.data(OCR2B) == 100
    send(chip, CommandRequest(command=command))
    run_for(chip, MILLISECOND_S)
    assert [chip.data(address) for address in (OCR2A, OCR2B)] == [0, 0]


def test_an_edge_during_the_control_tick_tears_no_count() -> None:
    """At each cycle of the tick in turn an edge carries into the high byte of the count."""
    chip = InstrumentedChip(ELF)
    run_for(chip, 0.15)
    time_us = symbol(ELF, "samples").address
    tick_cycles = CPU_HZ // 10
    stored = chip.data(time_us)
    while chip.data(time_us) == stored:
        chip.run(chip.cycle + 1)
    tick_cycle = chip.cycle  # the tick has read the counts before
    with chip.edges(ENCODERS[BoardModel.TREX][0]) as source:
        expected = 0
        seen = set()
        for before_cycles in range(TICK_READS_WITHIN, 0, -1):
            source.start(delay_cycles=100, interval_cycles=200, count=0xFF)
            tick_cycle += tick_cycles
            chip.run(tick_cycle - TICK_READS_WITHIN - 100)
            source.start(delay_cycles=tick_cycle - before_cycles - chip.cycle, interval_cycles=1, count=1)
            chip.run(tick_cycle + 1000)
            count = int.from_bytes(bytes(chip.data(time_us + 4 + i) for i in range(4)), "little")
            seen.add(count - expected)
            expected += 0x100
    assert seen == {0xFF, 0x100}


def test_a_lost_link_does_not_wait_for_the_control_tick() -> None:
    chip = armed(pwm=100)
    start_s = chip.time_s
    send(chip, SetMotorPwm(left=100, right=100))
    while chip.data(OCR2A) and chip.time_s < start_s + 1.0:
        run_for(chip, MILLISECOND_S / 4)
    assert chip.time_s - start_s == pytest.approx(0.3, abs=2 * MILLISECOND_S)


@pytest.mark.parametrize(
    ("flags", "cause", "kept"),
    [
        (PORF, ResetCause.POWER_ON, Fault.NONE),
        (PORF | BORF, ResetCause.POWER_ON, Fault.NONE),
        (BORF, ResetCause.BROWN_OUT, Fault.E_STOP),
        (WDRF, ResetCause.WATCHDOG, Fault.E_STOP),
        (0, ResetCause.UNKNOWN, Fault.E_STOP),
    ],
)
def test_power_on_clears_a_latched_fault_that_sram_still_holds(
    flags: int, cause: ResetCause, kept: Fault
) -> None:
    chip = InstrumentedChip(ELF, params=RobotParams.load())
    run_for(chip, 0.2)
    send(chip, CommandRequest(command=Command.E_STOP))
    run_for(chip, 0.1)
    chip.reset()
    chip.poke(MCUSR, flags)
    last = telemetry(chip, 0.15)
    assert last.fault is kept
    assert last.state is (State.DISARMED if kept is Fault.NONE else State.FAULT)
    answer = identity(chip)
    assert answer is not None
    assert answer.reset_cause is cause


@pytest.mark.parametrize(("byte", "change"), [(2, 0x10), (0, Fault.E_STOP ^ len(Fault))])
def test_other_content_of_the_kept_sram_is_no_fault(byte: int, change: int) -> None:
    """After other firmware, or a brown-out: another schema, or a fault beyond the last one."""
    chip = InstrumentedChip(ELF, params=RobotParams.load())
    run_for(chip, 0.2)
    send(chip, CommandRequest(command=Command.E_STOP))
    run_for(chip, 0.1)
    (kept,) = (address for address in NOINIT if _kept(chip, address) == SCHEMA_HASH ^ Fault.E_STOP)
    chip.reset()
    chip.poke(kept + byte, chip.data(kept + byte) ^ change)
    assert telemetry(chip, 0.15).fault is Fault.NONE


def _kept(chip: InstrumentedChip, address: int) -> int:
    return int.from_bytes(bytes(chip.data(address + i) for i in range(4)), "little")


def test_a_converter_that_stops_is_noticed() -> None:
    chip = FaultyChip(ELF, params=RobotParams.load())
    run_for(chip, 0.3)
    assert telemetry(chip).battery_mV > 7000
    chip.stop_adc(stopped=True)
    last = telemetry(chip, 0.25)
    assert (last.fault, last.battery_mV) == (Fault.ADC_STOPPED, 0)


def test_a_busy_main_loop_notices_that_the_converter_stops() -> None:
    """It passes only every few milliseconds, so the state must last."""
    chip = FaultyChip(ELF, params=RobotParams.load())
    run_for(chip, 0.3)
    chip.stop_adc(stopped=True)
    for _ in range(30):
        chip.send(9 * encode_frame(Identify.ID, 7, Identify().pack()))
        run_for(chip, 0.0025)
    assert telemetry(chip).fault is Fault.ADC_STOPPED


def test_short_gaps_of_the_converter_do_not_add_up() -> None:
    """50 ms without a result are a fault, but not two times 30."""
    chip = FaultyChip(ELF, params=RobotParams.load())
    run_for(chip, 0.3)
    for stopped in (True, False) * 4:
        chip.stop_adc(stopped=stopped)
        run_for(chip, 0.03)
    assert telemetry(chip).fault is Fault.NONE


def test_the_start_stops_the_watchdog() -> None:
    """After a watchdog reset it runs on, with 16 ms, until the program stops it: before anything else."""
    chip = InstrumentedChip(ELF)
    chip.poke(WDTCSR, WDE)
    chip.run(chip.cycle + 100)
    assert chip.data(WDTCSR) == 0


def test_the_reset_cause_is_told_once() -> None:
    """Else a power-on would be reported after every later reset too."""
    chip = InstrumentedChip(ELF)
    run_for(chip, 0.01)
    assert chip.data(MCUSR) == 0


def test_the_processor_sleeps_while_nothing_is_due() -> None:
    chip = InstrumentedChip(ELF)
    run_for(chip, 1.0)
    assert chip.cpu_load < 0.5


def test_the_first_battery_reading_is_a_mean_of_whole_samples() -> None:
    chip = InstrumentedChip(ELF, params=RobotParams.load())
    assert telemetry(chip, 0.12).battery_mV == pytest.approx(1000 * chip.truth().battery_V, rel=0.01)


def test_a_clock_that_never_starts_is_noticed_within_the_first_time_out() -> None:
    """Control ticks go on without it, but the watchdog must not be kept off by them, not even once."""
    chip = InstrumentedChip(ELF)
    while not chip.data(TIMSK0):
        chip.run(chip.cycle + 1)
    chip.poke(TIMSK0, 0)
    while not chip.data(TIMSK0) and chip.time_s < 1.0:  # a restart switches the clock on again
        run_for(chip, MILLISECOND_S)
    assert chip.time_s < 0.3


def test_a_fault_found_at_a_tick_stops_the_motors_in_the_same_pass() -> None:
    """Not with the next millisecond."""
    chip = InstrumentedChip(ELF, params=RobotParams.load())
    run_for(chip, 0.2)
    send(chip, SetParameter(index=parameter_named("left_encoder_reversed").index, value=1))
    send(chip, CommandRequest(command=Command.ARM))
    ticks = symbol(ELF, "samples").address
    seen = tick = 0
    for step in range(round(1.0 / STEP_S)):
        if step % 1000 == 0:
            send(chip, SetMotorPwm(left=100, right=100))
        run_for(chip, STEP_S)
        if chip.data(ticks) != seen:
            seen, tick = chip.data(ticks), step
        if tick and step > 10_000 and not chip.data(OCR2A):
            break
    assert telemetry(chip).fault is Fault.REVERSED_LEFT
    assert (step - tick) * STEP_S < 0.5 * MILLISECOND_S
