"""All mutants of firmware/core: one operator or constant changed at a time."""

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

FIRMWARE = Path(__file__).resolve().parents[3] / "firmware"
CORE = FIRMWARE / "core"
SKIPPED = {"messages.hpp"}  # generated, and another test compares it with the schema

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
TOKEN = re.compile(
    "|".join(sorted((re.escape(operator) for operator in OPERATORS), key=len, reverse=True))
    + r"|(?<![\w.])(?:0x[0-9A-Fa-f]+|\d+)(?=[uUlL]*\b)"
)
COMMENT = re.compile(r"//.*|^\s*#.*")


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


def mutants() -> list[Mutant]:
    """Return every mutant, in the order of files and lines."""
    return [
        mutant for path in sorted(CORE.glob("*.hpp")) if path.name not in SKIPPED for mutant in _of_file(path)
    ]


def _of_file(path: Path) -> Iterator[Mutant]:
    inside_assert = False  # inside a static_assert, which only states a condition
    seen = Counter[str]()
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        inside_assert = inside_assert or "static_assert(" in line
        code = COMMENT.sub("", line)
        seen[code.strip()] += 1
        if not inside_assert and "template <" not in line and "__attribute__" not in line and '"' not in code:
            for match in TOKEN.finditer(code):
                old = match[0]
                new = OPERATORS.get(old) or str(int(old, 0) + 1)
                change = f" «{old.strip()} → {new.strip()}» "
                key = " ".join(
                    (path.name + ": " + code[: match.start()] + change + code[match.end() :]).split()
                )
                yield Mutant(
                    file=path.name,
                    line=number,
                    column=match.start(),
                    old=old,
                    new=new,
                    key=key if seen[code.strip()] == 1 else f"{key} (no. {seen[code.strip()]})",
                )
        inside_assert = inside_assert and not line.rstrip().endswith(");")
