"""A mutant: the firmware with one change at one place."""

from dataclasses import dataclass
from pathlib import Path

FIRMWARE = Path(__file__).resolve().parents[3] / "firmware"
CORE = FIRMWARE / "core"

OPERATORS = {
    "==": "!=",
    "!=": "==",
    "<=": "<",
    ">=": ">",
    "&&": "||",
    "||": "&&",
    "+=": "-=",
    "-=": "+=",
    "++": "--",
    "--": "++",
    "<<": ">>",
    ">>": "<<",
    " < ": " <= ",
    " > ": " >= ",
    " + ": " - ",
    " - ": " + ",
    " * ": " + ",
    " / ": " * ",
    " ^ ": " | ",
    " & ": " | ",
    "true": "false",
    "false": "true",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutant:
    """One change at one place."""

    file: str
    line: int  # from 1
    column: int
    old: str
    new: str
    key: str
    """File and changed code: names the mutant although its line moves."""

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column + 1}: {self.old.strip()} -> {self.new.strip()}"

    def apply(self, text: str) -> str:
        """Return the file's text with the change."""
        start = sum(map(len, text.splitlines(keepends=True)[: self.line - 1])) + self.column
        return text[:start] + self.new + text[start + len(self.old) :]
