"""The desk suite is itself tested: it must notice flipped operators and constants in the core."""

import random

from tests.firmware.mutation.mutants import CORE, mutants
from tests.firmware.mutation.run import fails_unchanged, survivors

SAMPLE = 3


def test_each_mutant_changes_its_line_only() -> None:
    for mutant in mutants():
        text = (CORE / mutant.file).read_text(encoding="utf-8")
        before, after = text.splitlines(), mutant.apply(text).splitlines()
        differing = [i + 1 for i, (b, a) in enumerate(zip(before, after, strict=True)) if a != b]
        assert differing == [mutant.line]


def test_the_suite_passes_without_a_change() -> None:
    """Or every mutant would count as noticed."""
    assert fails_unchanged() == ""


def test_a_sample_of_mutants_is_killed() -> None:
    """`make mutation` takes all of them; docs/firmware.md says who survives, and why."""
    chosen = random.Random(4).sample([m for m in mutants() if m.file == "pi.hpp"], SAMPLE)
    assert list(survivors(chosen, jobs=1)) == []
