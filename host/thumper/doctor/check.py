"""One line of the doctor's report."""

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["pass", "warn", "fail"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """What was looked at, how it is, and what mends it."""

    verdict: Verdict
    what: str
    cure: str = ""


def worst_of(warn: bool, fail: bool) -> Verdict:
    """The verdict of two limits."""
    return "fail" if fail else "warn" if warn else "pass"
