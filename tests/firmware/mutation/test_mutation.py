"""Tests the tests: they must notice flipped operators and constants in the core."""

import subprocess
import sys

from tests.firmware.mutation.mutants import CORE, mutants


def test_each_mutant_changes_its_line_only() -> None:
    for mutant in mutants():
        text = (CORE / mutant.file).read_text(encoding="utf-8")
        before, after = text.splitlines(), mutant.apply(text).splitlines()
        differing = [i + 1 for i, (b, a) in enumerate(zip(before, after, strict=True)) if a != b]
        assert differing == [mutant.line]


def test_a_sample_of_mutants_is_killed() -> None:
    """Also checks that the suite passes without a change. Runs in its own process, so that no test module is
    imported yet. `make mutation` runs all; docs/firmware.md lists the survivors and why they survive."""
    command = [sys.executable, "-m", "tests.firmware.mutation.run", "--jobs", "1"]
    command += ["--only", "pi.hpp", "--sample", "3", "--seed", "4"]
    result = subprocess.run(command, capture_output=True, text=True, check=False, cwd=CORE.parents[1])
    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stdout == "3 of 3 mutants killed, 100.0 %\n"
