"""Reads the lists of survivors: the mutants that no test notices, each by name with the reason."""

import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.firmware.mutation.mutants import Mutant

CORE_SURVIVORS, BOARD_SURVIVORS = (
    Path(__file__).with_name(f"{part}_survivors.toml") for part in ("core", "board")
)
SAME_IMAGE, BROKEN = "same image", "does not compile"
"""Results of mutants that need no test."""


@dataclass(frozen=True, slots=True)
class Reason:
    """Why no test notices a mutant."""

    kind: str  # equivalent: no input shows a difference; or accepted
    text: str


def listed_survivors(path: Path) -> Mapping[str, Reason]:
    """Return the reason of each listed survivor by `Mutant.key`.

    Raises ValueError if a mutant is listed twice or its reason is not one of `equivalent` and `accepted`.
    """
    listed: dict[str, Reason] = {}
    for group in tomllib.loads(path.read_text(encoding="utf-8"))["survivors"]:
        kinds = [kind for kind in ("equivalent", "accepted") if group.get(kind)]
        if len(kinds) != 1:
            raise ValueError(f"{path.name}: {group['mutants']}: give one reason, `equivalent` or `accepted`")
        for key in group["mutants"]:
            if key in listed:
                raise ValueError(f"{path.name}: listed twice: {key}")
            listed[key] = Reason(kinds[0], group[kinds[0]])
    return listed


class Tally:
    """Counts the results and keeps what differs from the listed survivors."""

    def __init__(self, every: Sequence[Mutant], survivors: Path) -> None:
        self.listed = listed_survivors(survivors)
        gone = self.listed.keys() - {mutant.key for mutant in every}
        self.wrong = [f"listed, but no such mutant: {key}" for key in sorted(gone)]
        self.counts = Counter[str]()

    def add(self, mutant: Mutant, failure: str) -> None:
        """Add a mutant and the test that noticed it, if any; print it if none did."""
        name, reason = (
            f"{mutant.file}:{mutant.line}: {mutant.key.partition(': ')[2]}",
            self.listed.get(mutant.key),
        )
        if failure in (SAME_IMAGE, BROKEN):
            self.counts[failure] += 1
        else:
            self.counts["noticed" if failure else reason.kind if reason else "not listed"] += 1
        if failure and reason:
            self.wrong.append(f"listed, but noticed by {failure.splitlines()[0]}: {name}")
        elif not failure and reason:
            print(f"{name}\n    {reason.kind}: {reason.text}")
        elif not failure:
            self.wrong.append(f"not noticed and not listed: {name}")
            print(self.wrong[-1])

    def share(self) -> float:
        """Return the share noticed of the mutants that compile and are not equivalent."""
        left_out = sum(self.counts[kind] for kind in ("equivalent", SAME_IMAGE, BROKEN))
        return self.counts["noticed"] / max(1, self.counts.total() - left_out)
