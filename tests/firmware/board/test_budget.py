"""Cycle budgets of the flashed ELF on the emulated chip."""

import itertools
import random

import pytest

from tests.firmware.board.boot import ELF, compiler_of
from tests.firmware.board.wire import frames
from thumper.board.framing import encode_frame
from thumper.board.messages import (
    PARAMETERS,
    Ack,
    AckStatus,
    Command,
    CommandRequest,
    GetParameter,
    Message,
    ParameterSpec,
    SetParameter,
    SetWheelSpeeds,
    State,
    Telemetry,
)
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.instrumented_chip import TICK_VECTOR, InstrumentedChip
from thumper_hil.chip.native_library import CProbeReport
from thumper_hil.chip.preemption import symbol
from thumper_hil.chip.robot_params import RobotParams

EDGE_VECTORS = (3, 5)  # PCINT0, PCINT2
EDGE_CYCLES = 75  # entry to RETI, including the response's 4
TICK_CYCLES = {"5": 1700, "7": 1900}  # by gcc's version: both wheels, ramp, feed-forward and PI
OFF_CYCLES = 150
TWI_CYCLES = 20  # 18 were measured
STACK_BYTES = 192  # 151 were measured; 1280 are free
TWI_VECTOR = 24
INDEX = {spec.name: spec.index for spec in PARAMETERS}
SLOWEST = {
    "kp": 3198,
    "ki": 15_729,
    "ks": 1492,
    "kv": 5049,
    "ka": 730,
    "acceleration": 800,
    "deceleration": 1600,
    "counts_per_rev": 1911,
    "left_motor_reversed": 1,
    "right_motor_reversed": 0,
    "left_encoder_reversed": 1,
    "right_encoder_reversed": 1,
}
"""Of the gains that a random search of seven minutes tried, those with the longest tick."""
DIRECTIONS = [name for name in INDEX if name.endswith("_reversed")]


def frame(message: Message) -> bytes:
    return encode_frame(message.ID, 1, message.pack())


@pytest.fixture(scope="module", params=["plain", "gyroscope"])
def report(request: pytest.FixtureRequest) -> CProbeReport:
    """Two seconds of driving with incoming commands and requests, measured after the first sei."""
    chip = InstrumentedChip(ELF, params=RobotParams.load())
    chip.run(CPU_HZ // 5)
    if request.param == "gyroscope":
        chip.fit_gyroscope()
        chip.send(frame(SetParameter(index=INDEX["gyroscope"], value=1)))
        chip.run(chip.cycle + CPU_HZ // 2)
    with chip.probe() as probe:
        chip.send(frame(CommandRequest(command=Command.ARM)))
        for step in range(40):
            speeds = SetWheelSpeeds(left=8000 if step % 20 < 10 else -8000, right=6000)
            chip.send(frame(speeds) + frame(GetParameter(index=step % 7)))
            probe.run(chip.cycle + CPU_HZ // 20)
        assert min(map(abs, chip.truth().encoder_count)) > 100
        measured: CProbeReport = probe.report()
        bytes_of_the_bus = measured.vector[TWI_VECTOR]
        assert (10_000 < bytes_of_the_bus.entries < 20_000) is (request.param == "gyroscope")
        assert bytes_of_the_bus.most <= TWI_CYCLES
        return measured


@pytest.mark.parametrize("vector", EDGE_VECTORS)
def test_an_edge_stays_within_its_cycles(report: CProbeReport, vector: int) -> None:
    assert 0 < report.vector[vector].most <= EDGE_CYCLES


def test_the_control_tick_stays_within_its_cycles(report: CProbeReport) -> None:
    assert 0 < report.vector[TICK_VECTOR].most <= TICK_CYCLES[compiler_of(ELF)[0]]


@pytest.mark.parametrize("reversed_", list(itertools.product((0, 1), repeat=len(DIRECTIONS))))
def test_every_combination_of_directions_stays_within_the_tick_s_cycles(reversed_: tuple[int, ...]) -> None:
    """Each motor turns round at its own times, so some ticks reverse one motor, some both."""
    chip = InstrumentedChip(ELF, params=RobotParams.load(), seed=1)
    chip.run(CPU_HZ // 5)
    for name, value in zip(DIRECTIONS, reversed_, strict=True):
        chip.send(frame(SetParameter(index=INDEX[name], value=value)))
    chip.run(chip.cycle + CPU_HZ // 10)
    assert [Ack.unpack(f.payload).status for f in frames(chip) if f.message_id == Ack.ID] == [
        AckStatus.OK
    ] * 4
    seen: list[Telemetry] = []
    with chip.probe() as probe:
        for step in range(60):
            chip.send(frame(CommandRequest(command=Command.CLEAR_FAULT)))
            chip.send(frame(CommandRequest(command=Command.ARM)))
            left, right = (speed if step // steps % 2 else -speed for speed, steps in ((8000, 10), (6000, 7)))
            chip.send(frame(SetWheelSpeeds(left=left, right=right)))
            probe.run(chip.cycle + CPU_HZ // 20)
            seen += [Telemetry.unpack(f.payload) for f in frames(chip) if f.message_id == Telemetry.ID]
        most = probe.report().vector[TICK_VECTOR].most
    assert any(sample.state is State.CLOSED_LOOP for sample in seen)
    assert max(abs(sample.left_pwm) for sample in seen) > 50
    assert max(abs(sample.right_pwm) for sample in seen) > 50
    assert max(abs(sample.left_count) for sample in seen) > 100
    assert max(abs(sample.right_count) for sample in seen) > 100
    assert 0 < most <= TICK_CYCLES[compiler_of(ELF)[0]]


def wire_value(rng: random.Random, spec: ParameterSpec) -> int:
    limits = round(spec.minimum * spec.scale), round(spec.maximum * spec.scale)
    return rng.choice([*limits, rng.randint(*limits)])


@pytest.mark.parametrize("gains", ["random", "slowest"])
def test_counts_and_gains_of_any_size_stay_within_the_tick_s_cycles(gains: str) -> None:
    """Noise on an encoder's lines may count far more than a wheel can turn."""
    rng = random.Random(1)
    chip = InstrumentedChip(ELF, params=RobotParams.load(), seed=1)
    chip.run(CPU_HZ // 5)
    encoders = [symbol(ELF, name).address + 1 for name in ("left_encoder", "right_encoder")]
    with chip.probe() as probe:
        for step in range(160):
            if step % 40 == 0:
                chip.send(frame(CommandRequest(command=Command.DISARM)))
                for spec in PARAMETERS:
                    if spec.name in SLOWEST:
                        value = wire_value(rng, spec) if gains == "random" else SLOWEST[spec.name]
                        chip.send(frame(SetParameter(index=spec.index, value=value)))
            chip.send(frame(CommandRequest(command=Command.CLEAR_FAULT)))
            chip.send(frame(CommandRequest(command=Command.ARM)))
            left, right = (
                rng.choice([0, 17_000, rng.randint(-17_000, 17_000), rng.randint(-800, 800)])
                for _ in range(2)
            )
            chip.send(frame(SetWheelSpeeds(left=left, right=right)))
            probe.run(chip.cycle + CPU_HZ // 20)
            for address in encoders:
                before = chip.data(address) | chip.data(address + 1) << 8
                count = before + rng.choice([0, rng.randint(-9000, 9000)])
                chip.poke(address, count & 0xFF)
                chip.poke(address + 1, count >> 8 & 0xFF)
            probe.run(chip.cycle + CPU_HZ // 20)
        most = probe.report().vector[TICK_VECTOR].most
    assert 0 < most <= TICK_CYCLES[compiler_of(ELF)[0]]


def test_interrupts_are_never_off_for_long(report: CProbeReport) -> None:
    assert 0 < report.interrupts_off <= OFF_CYCLES


def test_the_stack_stays_small_beside_the_static_memory(report: CProbeReport) -> None:
    assert 0 < report.deepest_stack <= STACK_BYTES
