"""An interrupt at any instruction of the main loop tears nothing. Without a guard, the sweep finds where."""

import shutil
import subprocess
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import pytest

from tests.firmware.board.boot import ELF, ROOT
from tests.firmware.preemption.scenarios import (
    SCENARIOS,
    Scenario,
    command_is_whole,
    edges_are_counted,
    reversal_rests,
    sensors_go_on,
    telemetry_is_whole,
    tone_leaves_the_motors_off,
)
from thumper_hil.chip.preemption import Interrupt


@dataclass(frozen=True, slots=True)
class Guard:
    """What to remove from a file of the firmware, and how a sweep then fails."""

    scenario: Scenario
    old: str
    expected: str
    new: str = ""
    interrupt: Interrupt = Interrupt.TICK
    file: str = "app/main.cpp"


GUARDS: dict[str, Guard] = {
    "repeat of a copy that a tick interrupted": Guard(
        telemetry_is_whole, "} while (ticks != 0);", "telemetry mixes two ticks", "} while (false);"
    ),
    "atomic command": Guard(
        command_is_whole,
        "ATOMIC_BLOCK(ATOMIC_FORCEON) {  // only these three stores",
        "the tick obeys",
        "{  //",
    ),
    "hold of the tick": Guard(reversal_rests, "tick::Hold();", "motor rested"),
    "count of dropped telemetry": Guard(
        telemetry_is_whole,
        "host.CountDropped(static_cast<uint8_t>(Collect(host.samples()) - 1));",
        "counted as dropped",
        "Collect(host.samples());",
    ),
    "atomic switch of the tone": Guard(
        tone_leaves_the_motors_off,
        "ATOMIC_BLOCK(ATOMIC_FORCEON) {",
        "motor rested",
        "{",
        Interrupt.MILLISECOND,
        "board/beeper.hpp",
    ),
    "register that the I2C interrupt saves": Guard(
        sensors_go_on, '"pop r24\\n\\t"', "crashed", '"pop r0\\n\\t"', Interrupt.I2C, "board/mpu6050.hpp"
    ),
    "flags that the edge interrupt restores": Guard(
        edges_are_counted,
        '"out __SREG__, r24\\n\\t"',
        "a damaged frame",
        interrupt=Interrupt.LEFT_EDGE,
        file="board/encoder_edge.hpp",
    ),
    "register that the analogue interrupt leaves alone": Guard(
        sensors_go_on,
        "adc.ConvertAxis();",
        "crashed",
        'adc.ConvertAxis(); __asm__ volatile("clr r9");',
        Interrupt.ANALOGUE,
    ),
    "bytes that the millisecond interrupt leaves to the main loop": Guard(
        command_is_whole,
        "  adc.Step();",
        "the tick obeys",
        "  adc.Step(); uint8_t byte; uart.Get(&byte);",
        Interrupt.MILLISECOND,
    ),
    "end of the tone's pulse": Guard(
        tone_leaves_the_motors_off, "beeper.End();", "a motor was on", interrupt=Interrupt.TONE_PULSE
    ),
}

# One guard of an atomic block and one of an interrupt in assembly; each of the others takes 2 to 8 s.
QUICK = ("atomic switch of the tone", "flags that the edge interrupt restores")


def failures_of(scenario: Scenario, elf: Path, interrupt: Interrupt) -> list[str]:
    """Run a scenario in a small new process: it forks thousands of times, and a fork copies page tables."""
    stride = SCENARIOS[scenario][interrupt]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as small_process:
        return small_process.submit(scenario, elf, interrupt, stride).result()


@pytest.mark.parametrize(
    ("scenario", "interrupt"),
    [(scenario, interrupt) for scenario, interrupts in SCENARIOS.items() for interrupt in interrupts],
    ids=lambda value: value.name.lower() if isinstance(value, Interrupt) else value.__name__,
)
def test_an_interrupt_anywhere_tears_nothing(scenario: Scenario, interrupt: Interrupt) -> None:
    assert failures_of(scenario, ELF, interrupt) == []


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in QUICK else [pytest.mark.slow]) for name in GUARDS]
)
def test_the_sweep_finds_a_missing_guard(name: str, tmp_path: Path) -> None:
    guard = GUARDS[name]
    firmware = tmp_path / "firmware"
    shutil.copytree(ROOT / "firmware", firmware, ignore=shutil.ignore_patterns("build"))
    source = firmware / guard.file
    text = source.read_text(encoding="utf-8")
    assert text.count(guard.old) == 1
    source.write_text(text.replace(guard.old, guard.new), encoding="utf-8")
    subprocess.run(["make", "-s", "-C", str(firmware)], check=True, capture_output=True)
    elf = firmware / "build" / "thumper.elf"
    failures = failures_of(guard.scenario, elf, guard.interrupt)
    assert any(guard.expected in failure for failure in failures), failures
