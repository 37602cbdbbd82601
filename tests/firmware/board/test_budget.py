"""Cycle budgets of the flashed ELF on the emulated chip."""

import pytest

from tests.firmware.board.boot import ELF, compiler_of
from thumper.board.framing import encode_frame
from thumper.board.messages import (
    PARAMETERS,
    Command,
    CommandRequest,
    GetParameter,
    Message,
    SetParameter,
    SetWheelSpeeds,
)
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.instrumented_chip import TICK_VECTOR, InstrumentedChip
from thumper_hil.chip.native_library import CProbeReport
from thumper_hil.chip.robot_params import RobotParams

EDGE_VECTORS = (3, 5)  # PCINT0, PCINT2
EDGE_CYCLES = 75  # entry to RETI, including the response's 4
TICK_CYCLES = {"5": 1500, "7": 1800}  # by gcc's version: both wheels, ramp, feed-forward and PI
OFF_CYCLES = 150
TWI_VECTOR = 24
GYROSCOPE = next(spec.index for spec in PARAMETERS if spec.name == "gyroscope")


def frame(message: Message) -> bytes:
    return encode_frame(message.ID, 1, message.pack())


@pytest.fixture(scope="module", params=["plain", "gyroscope"])
def report(request: pytest.FixtureRequest) -> CProbeReport:
    """Two seconds of driving with incoming commands and requests, measured after the first sei."""
    chip = InstrumentedChip(ELF, params=RobotParams.load())
    chip.run(CPU_HZ // 5)
    if request.param == "gyroscope":
        chip.fit_gyroscope()
        chip.send(frame(SetParameter(index=GYROSCOPE, value=1)))
        chip.run(chip.cycle + CPU_HZ // 2)
    with chip.probe() as probe:
        chip.send(frame(CommandRequest(command=Command.ARM)))
        for step in range(40):
            speeds = SetWheelSpeeds(left=8000 if step % 20 < 10 else -8000, right=6000)
            chip.send(frame(speeds) + frame(GetParameter(index=step % 7)))
            probe.run(chip.cycle + CPU_HZ // 20)
        assert min(map(abs, chip.truth().encoder_count)) > 100
        measured: CProbeReport = probe.report()
        assert (measured.vector[TWI_VECTOR].entries > 10_000) is (request.param == "gyroscope")
        return measured


@pytest.mark.parametrize("vector", EDGE_VECTORS)
def test_an_edge_stays_within_its_cycles(report: CProbeReport, vector: int) -> None:
    assert 0 < report.vector[vector].most <= EDGE_CYCLES


def test_the_control_tick_stays_within_its_cycles(report: CProbeReport) -> None:
    assert 0 < report.vector[TICK_VECTOR].most <= TICK_CYCLES[compiler_of(ELF)[0]]


def test_interrupts_are_never_off_for_long(report: CProbeReport) -> None:
    assert 0 < report.interrupts_off <= OFF_CYCLES


def test_the_stack_fits_beside_the_static_memory(report: CProbeReport) -> None:
    assert 0 < report.deepest_stack <= 2048 - 768
