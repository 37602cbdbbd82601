"""Tests the tests: they must notice flipped operators and constants in the core."""

import subprocess
import sys
from dataclasses import replace

import pytest

from tests.firmware.board.boot import ROOT
from tests.firmware.mutation.guards import GUARDS, is_noticed
from tests.firmware.mutation.hazards import HAZARDS, chosen_test, without
from tests.firmware.mutation.mutants import CORE, mutants
from tests.firmware.mutation.survivors import Tally, listed_survivors

SAFETY_CASE = ROOT / "docs" / "explanation" / "safety.md"


def test_each_mutant_changes_its_line_only() -> None:
    for mutant in mutants():
        text = (CORE / mutant.file).read_text(encoding="utf-8")
        before, after = text.splitlines(), mutant.apply(text).splitlines()
        differing = [i + 1 for i, (b, a) in enumerate(zip(before, after, strict=True)) if a != b]
        assert differing == [mutant.line]


@pytest.mark.parametrize(
    ("guard", "file", "test"),
    [
        ("watchdog", "board/test_bootloader.py", "test_a_hang_with_interrupts_on_is_recovered"),
        (
            "milliseconds for the watchdog",
            "board/test_bootloader.py",
            "test_a_dead_millisecond_timer_is_noticed",
        ),
        ("latched fault survives", "board/test_bootloader.py", "test_a_latched_fault_outlasts_a_reset"),
        ("rest of the left motor", "board/test_reversal.py", "test_a_turning_motor_rests_first"),
        ("protecting inputs", "board/test_inputs.py", "test_a_switch_stops_the_motors_within_a_tick"),
        (
            "readings of the accelerometer",
            "board/test_accelerometer.py",
            "test_a_collision_stops_the_motors",
        ),
        (
            "bounded reading of requests",
            "board/test_link_noise.py",
            "test_a_host_that_never_pauses_keeps_neither_time_out_nor_watchdog_away",
        ),
    ],
)
def test_a_test_of_the_safety_case_fails_without_the_guard(guard: str, file: str, test: str) -> None:
    """A sample. `python -m tests.firmware.mutation.guards` removes every guard."""
    assert f"`tests/firmware/{file}::{test}`" in SAFETY_CASE.read_text(encoding="utf-8")
    assert is_noticed(replace(GUARDS[guard], test=f"{file} -k {test}"))


def test_each_hazard_of_the_board_has_a_guard_to_remove() -> None:
    """`python -m tests.firmware.mutation.hazards` removes them and runs the tests."""
    section = SAFETY_CASE.read_text(encoding="utf-8").split("## Board, motors, battery")[1].split("\n## ")[0]
    hazards = [line.split(" | ")[0].removeprefix("| ") for line in section.splitlines() if "::test_" in line]
    assert set(hazards) - set(HAZARDS) == {"tests on a real board with wheels on the ground"}
    for hazard, removal in HAZARDS.items():
        assert chosen_test(hazard)
        source = CORE.parent / removal.file
        assert without(removal, source.read_text(encoding="utf-8"))


def test_each_listed_survivor_is_a_mutant_and_no_two_have_the_same_name() -> None:
    keys = [mutant.key for mutant in mutants()]
    assert len(set(keys)) == len(keys)
    assert listed_survivors().keys() <= set(keys), "update survivors.toml"


def test_a_sample_of_mutants_is_noticed_unless_listed() -> None:
    """Also checks that the suite passes without a change. Runs in its own process, so that no test module is
    imported yet. `make mutation` runs all."""
    command = [sys.executable, "-m", "tests.firmware.mutation.run", "--jobs", "1", "--sample", "6"]
    result = subprocess.run(command, capture_output=True, text=True, check=False, cwd=CORE.parents[1])
    assert result.returncode == 0, result.stdout + result.stderr


def test_a_survivor_that_is_not_listed_and_a_listed_one_that_is_noticed_fail(
    capsys: pytest.CaptureFixture[str],
) -> None:
    every = mutants()
    listed, other = (
        next(mutant for mutant in every if (mutant.key in listed_survivors()) is wanted)
        for wanted in (True, False)
    )
    tally = Tally(every)
    tally.add(listed, "")
    tally.add(other, "some test")
    assert tally.wrong == []
    tally.add(other, "")
    tally.add(listed, "some test")
    assert [line.partition(":")[0] for line in tally.wrong] == [
        "not noticed and not listed",
        "listed, but noticed by some test",
    ]
    gone = Tally([mutant for mutant in every if mutant != listed])
    assert gone.wrong == [f"listed, but no such mutant: {listed.key}"]
    assert listed.key.partition(": ")[2] in capsys.readouterr().out
