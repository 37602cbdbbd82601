"""All mutants of firmware/app and firmware/board: what one place does is removed or weakened.

Removed: each statement, each instruction of the assembly, each bit of a register's value, each atomic block.
Weakened: each condition is always true or always false, each comparison and logical operator is exchanged,
each named number is halved.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from tests.firmware.mutation.mutants import FIRMWARE, OPERATORS, Mutant
from tests.firmware.mutation.statements import CONDITION, Change, closing, code_of, named, removed_statements

NAKED = re.compile(r"ISR\(\w+, ISR_NAKED\) \{.*\}")
INSTRUCTION = re.compile(r'^ *("[a-z]+ [^"\\]*\\n[^"]*"|"reti")', re.MULTILINE)
ATOMIC = re.compile(r"ATOMIC_BLOCK\(\w+\)")
BIT = re.compile(r"\b1 << [A-Z][A-Z0-9]+\b")
NUMBER = re.compile(r"\bk\w+ = (\d+)\b")
EXCHANGED = (
    "==",
    "!=",
    "<=",
    ">=",
    "&&",
    "||",
    "+=",
    "-=",
    "++",
    "--",
    " < ",
    " > ",
    " + ",
    " - ",
    " & ",
    " ^ ",
)
OPERATOR = re.compile("|".join(map(re.escape, EXCHANGED)) + r"|\btrue\b|\bfalse\b")


def sources() -> list[Path]:
    """Return the files that are changed."""
    return sorted(
        path
        for folder in ("app", "board")
        for path in (FIRMWARE / folder).iterdir()
        if path.suffix in {".cpp", ".hpp"}
    )


def board_mutants() -> list[Mutant]:
    """Return every mutant, in the order of files and places."""
    return [mutant for path in sources() for mutant in _of_file(path)]


def _of_file(path: Path) -> Iterator[Mutant]:
    text = path.read_text(encoding="utf-8")
    return named(str(path.relative_to(FIRMWARE)), text, _changes(text))


def _changes(text: str) -> Iterator[Change]:
    code = code_of(text)
    yield from removed_statements(text, NAKED.sub(lambda match: " " * len(match[0]), code))
    for match in INSTRUCTION.finditer(text):
        yield match.start(1), match[1], '""'
    for match in ATOMIC.finditer(code):
        yield match.start(), match[0], ""
    for match in BIT.finditer(code):
        yield match.start(), match[0], "0"
    for match in NUMBER.finditer(code):
        if int(match[1]) > 1:
            yield match.start(1), match[1], str(int(match[1]) // 2)
    for match in CONDITION.finditer(code):
        end = closing(code, match.end())
        for value in ("(true)", "(false)") if match[0] == "if " else ("(false)",):  # not for ever
            yield match.end(), text[match.end() : end], value
    asserted = [
        (match.start(), closing(code, match.end() - 1)) for match in re.finditer(r"static_assert\(", code)
    ]
    for match in OPERATOR.finditer(code):
        if not any(start < match.start() < end for start, end in asserted):
            yield match.start(), match[0], OPERATORS[match[0]]
