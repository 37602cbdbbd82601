"""One line of the report of `thumper doctor`."""

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["pass", "info", "warn", "fail"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """Verdict of a check, what was found, and how to fix it."""

    verdict: Verdict
    what: str
    fix: str = ""


def worst_of(warn: bool, fail: bool) -> Verdict:
    """Return the verdict for a warning and a failure limit."""
    return "fail" if fail else "warn" if warn else "pass"
