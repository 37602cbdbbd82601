"""Tests the tests: they must notice flipped operators and constants in the core."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from tests.firmware.mutation.board_mutants import board_mutants
from tests.firmware.mutation.core_mutants import core_mutants
from tests.firmware.mutation.hazards import (
    HAZARDS,
    NOT_OF_THE_FIRMWARE,
    chosen_test,
    hazards_of_the_safety_case,
    is_noticed,
    without,
)
from tests.firmware.mutation.mutants import CORE, FIRMWARE, Mutant
from tests.firmware.mutation.run import PARTS
from tests.firmware.mutation.survivors import CORE_SURVIVORS, Tally, listed_survivors
from tests.variants import some_of


@pytest.mark.parametrize(
    "hazard", some_of(["the robot runs into something that no sensor saw", "a flood of requests"])
)
def test_a_test_of_the_safety_case_fails_without_the_guard(hazard: str) -> None:
    """A sample. `python -m tests.firmware.mutation.hazards` goes through all of them."""
    assert is_noticed(hazard)


def test_each_hazard_has_a_guard_to_remove_or_is_not_the_firmware_s() -> None:
    """`python -m tests.firmware.mutation.hazards` removes the guards and runs the tests."""
    assert sorted(hazards_of_the_safety_case()) == sorted([*HAZARDS, *NOT_OF_THE_FIRMWARE])
    for hazard, removal in HAZARDS.items():
        assert chosen_test(hazard)
        source = CORE.parent / removal.file
        assert without(removal, source.read_text(encoding="utf-8"))


@pytest.mark.parametrize("part", PARTS)
def test_each_listed_survivor_is_a_mutant_and_no_two_have_the_same_name(part: str) -> None:
    _, all_mutants, survivors = PARTS[part]
    keys = [mutant.key for mutant in all_mutants()]
    assert len(set(keys)) == len(keys)
    assert listed_survivors(survivors).keys() <= set(keys), f"update {survivors.name}"


@pytest.mark.parametrize(
    "guard",
    [
        "ATOMIC_BLOCK(ATOMIC_FORCEON)",
        "ATOMIC_BLOCK(ATOMIC_RESTORESTATE)",
        "cli();",
        "motors::Halt();",
        "wdt_disable();",
        "PORTD |= pins::kLeftEncoder;",
        "left_encoder.Reset(PIND);",
        "(!host.supervisor().armed())",
        "(!beeper.sounding())",
        "1 << PORF",
        '"out __SREG__, r24\\n\\t"',
        "drive_.Disconnect()",
        "PORTD |= pins::kLeftForward;",
        "left_rest_ = kRest;",
    ],
)
def test_each_guard_of_the_board_is_removed(guard: str) -> None:
    """The generator must find calls, assignments, atomic blocks, conditions, bits and instructions."""
    assert any(guard in mutant.old for mutant in board_mutants())


@pytest.mark.parametrize(("folder", "all_mutants"), [(CORE, core_mutants), (FIRMWARE, board_mutants)])
def test_a_mutant_changes_only_its_place(folder: Path, all_mutants: Callable[[], list[Mutant]]) -> None:
    for mutant in all_mutants():
        text = (folder / mutant.file).read_text(encoding="utf-8")
        changed = mutant.apply(text)
        assert changed != text
        assert replace(mutant, old=mutant.new, new=mutant.old).apply(changed) == text


@pytest.mark.parametrize(
    "guard",
    [
        "(silence_ms_ >= kLinkTimeout_ms)",
        "Trip(Fault::kAdcStopped);",
        "pi_.Reset();",
        "next_slot_ ^= 1;",
        "(high_)",
    ],
)
def test_each_guard_of_the_core_is_removed(guard: str) -> None:
    assert any(guard in mutant.old for mutant in core_mutants())


@pytest.mark.slow
@pytest.mark.parametrize(("part", "number"), [("core", 3), ("board", 2)])
def test_a_sample_of_mutants_is_noticed_unless_listed(part: str, number: int) -> None:
    """The tests that notice them must also pass without a change. Runs in its own process, so that no test
    module is imported yet. `make mutation` runs all."""
    command = [sys.executable, "-m", "tests.firmware.mutation.run", part]
    command += ["--jobs", "1", "--sample", str(number)]
    result = subprocess.run(command, capture_output=True, text=True, check=False, cwd=CORE.parents[1])
    assert result.returncode == 0, result.stdout + result.stderr


def test_a_survivor_that_is_not_listed_and_a_listed_one_that_is_noticed_fail(
    capsys: pytest.CaptureFixture[str],
) -> None:
    every = core_mutants()
    listed, other = (
        next(mutant for mutant in every if (mutant.key in listed_survivors(CORE_SURVIVORS)) is wanted)
        for wanted in (True, False)
    )
    tally = Tally(every, CORE_SURVIVORS)
    tally.add(listed, "")
    tally.add(other, "some test")
    assert tally.wrong == []
    tally.add(other, "")
    tally.add(listed, "some test")
    assert [line.partition(":")[0] for line in tally.wrong] == [
        "not noticed and not listed",
        "listed, but noticed by some test",
    ]
    gone = Tally([mutant for mutant in every if mutant != listed], CORE_SURVIVORS)
    assert gone.wrong == [f"listed, but no such mutant: {listed.key}"]
    assert listed.key.partition(": ")[2] in capsys.readouterr().out
