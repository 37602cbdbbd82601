"""An interrupt at any instruction of the main loop tears nothing. Without a guard, the sweep finds where."""

import shutil
import subprocess
from concurrent.futures import ProcessPoolExecutor
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
    telemetry_is_whole,
)
from thumper_hil.chip.preemption import Interrupt

STRIDE: dict[Scenario, int] = {telemetry_is_whole: 3, edges_are_counted: 12}
"""Sweeping every instruction takes minutes; `python -m tests.firmware.preemption.scenarios` does."""

GUARDS: dict[str, tuple[Scenario, str, str, str]] = {
    "repeat of a copy that a tick interrupted": (
        telemetry_is_whole,
        "} while (ticks != 0);",
        "} while (false);",
        "telemetry mixes two ticks",
    ),
    "atomic command": (
        command_is_whole,
        "ATOMIC_BLOCK(ATOMIC_FORCEON) {  // only these three stores",
        "{  //",
        "the tick obeys",
    ),
    "hold of the tick": (reversal_rests, "tick::Hold();", "", "motor rested"),
    "count of dropped telemetry": (
        telemetry_is_whole,
        "host.CountDropped(static_cast<uint8_t>(Collect(host.samples()) - 1));",
        "Collect(host.samples());",
        "counted as dropped",
    ),
}


def failures_of(scenario: Scenario, elf: Path, interrupt: Interrupt, stride: int) -> list[str]:
    """Run a scenario in a small new process: it forks thousands of times, and a fork copies page tables."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as small_process:
        return small_process.submit(scenario, elf, interrupt, stride).result()


@pytest.mark.parametrize(
    ("scenario", "interrupt"),
    [(scenario, interrupt) for scenario, interrupts in SCENARIOS.items() for interrupt in interrupts],
    ids=lambda value: value.name.lower() if isinstance(value, Interrupt) else value.__name__,
)
def test_an_interrupt_anywhere_tears_nothing(scenario: Scenario, interrupt: Interrupt) -> None:
    stride = STRIDE.get(scenario, 1) * (1 if interrupt is Interrupt.TICK else 5)
    assert failures_of(scenario, ELF, interrupt, stride) == []


@pytest.mark.parametrize("guard", GUARDS)
def test_the_sweep_finds_a_missing_guard(guard: str, tmp_path: Path) -> None:
    scenario, old, new, expected = GUARDS[guard]
    firmware = tmp_path / "firmware"
    shutil.copytree(ROOT / "firmware", firmware, ignore=shutil.ignore_patterns("build"))
    main = firmware / "app" / "main.cpp"
    text = main.read_text(encoding="utf-8")
    assert text.count(old) == 1
    main.write_text(text.replace(old, new), encoding="utf-8")
    subprocess.run(["make", "-s", "-C", str(firmware)], check=True, capture_output=True)
    elf = firmware / "build" / "thumper.elf"
    failures = failures_of(scenario, elf, Interrupt.TICK, STRIDE.get(scenario, 1))
    assert any(expected in failure for failure in failures), failures
