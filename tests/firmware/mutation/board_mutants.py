"""All mutants of firmware/app and firmware/board: what one place does is removed or weakened.

Removed: each statement, each instruction of the assembly, each bit of a register's value, each atomic block.
Weakened: each condition is always true or always false, each comparison and logical operator is exchanged,
each named number is halved.
"""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from tests.firmware.mutation.mutants import FIRMWARE, OPERATORS, Mutant

NOT_CODE = re.compile(r"//.*|^[ ]*#.*|\"(?:\\.|[^\"\\])*\"", re.MULTILINE)
NO_BODY = re.compile(r"(class|struct|enum|namespace)\b|extern\s*$")
INITIALIZER = re.compile(r"[=\]]\s*$")
LABEL = re.compile(r"(case\b.*|default|public|private)$", re.DOTALL)
CONTROL = re.compile(r"(?:else\s+)?(?:if|for|while|switch)\s*\(|else\s+|do\s+")
NAKED = re.compile(r"ISR\(\w+, ISR_NAKED\) \{.*\}")
KEPT = re.compile(
    r"(using|static_assert|constexpr|const|static|typedef|template|extern)\b|return |__builtin"
    r"|__asm__ volatile\(\s*\n|[\w:]+[*&]? \w+( =|;|\[)"
)
"""Declarations, values that are returned, and assembly, whose instructions are removed one by one."""
INSTRUCTION = re.compile(r'^ *("[a-z]+ [^"\\]*\\n[^"]*"|"reti")', re.MULTILINE)
ATOMIC = re.compile(r"ATOMIC_BLOCK\(\w+\)")
BIT = re.compile(r"\b1 << [A-Z][A-Z0-9]+\b")
NUMBER = re.compile(r"\bk\w+ = (\d+)\b")
CONDITION = re.compile(r"\b(?:if|while) (?=\()")
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

Change = tuple[int, str, str]
"""Offset in the file, old and new text."""


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
    file = str(path.relative_to(FIRMWARE))
    seen = Counter[str]()
    for offset, old, new in sorted(set(_changes(text))):
        before, _, start = text[:offset].rpartition("\n")
        rest = text[offset + len(old) :].partition("\n")[0]
        key = " ".join(f"{file}: {start}«{old.strip()} → {new.strip()}»{rest.partition('//')[0]}".split())
        seen[key] += 1
        yield Mutant(
            file=file,
            line=before.count("\n") + 2 if before or start != text[:offset] else 1,
            column=len(start),
            old=old,
            new=new,
            key=key if seen[key] == 1 else f"{key} (no. {seen[key]})",
        )


def _changes(text: str) -> Iterator[Change]:
    code = NOT_CODE.sub(lambda match: " " * len(match[0]), text)
    for start, end in _statements(NAKED.sub(lambda match: " " * len(match[0]), code)):
        simple = _without_control(code, start)
        # A condition before it is made false.
        if not CONDITION.match(code, start) and not KEPT.match(text, simple) and end > simple + 1:
            yield simple, text[simple:end], ";"
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
        end = _closing(code, match.end())
        for value in ("(true)", "(false)") if match[0] == "if " else ("(false)",):  # not for ever
            yield match.end(), text[match.end() : end], value
    asserted = [
        (match.start(), _closing(code, match.end() - 1)) for match in re.finditer(r"static_assert\(", code)
    ]
    for match in OPERATOR.finditer(code):
        if not any(start < match.start() < end for start, end in asserted):
            yield match.start(), match[0], OPERATORS[match[0]]


def _closing(code: str, start: int) -> int:
    """Return the end of the parenthesis that opens at `start`."""
    depth = 0
    for offset in range(start, len(code)):
        depth += (code[offset] == "(") - (code[offset] == ")")
        if depth == 0:
            return offset + 1
    raise ValueError("a parenthesis is not closed")


def _statements(code: str) -> Iterator[tuple[int, int]]:
    """Yield start and end of each simple statement in the bodies of functions."""
    blocks: list[bool | None] = []  # of each open brace: code, other declarations, or None: an initial value
    start, parentheses = -1, 0
    for offset, character in enumerate(code):
        if start < 0 and not character.isspace() and character not in "{};":
            start = offset
        parentheses += (character in "([") - (character in ")]")
        if parentheses or (start < 0 and character not in "{}"):
            continue
        head = code[max(start, 0) : offset]
        if character == "{":
            initializer = bool(INITIALIZER.search(head)) and blocks and blocks[-1]
            blocks.append(None if initializer else not NO_BODY.match(head))
        elif character == "}":
            if blocks.pop() is None:
                continue
        elif character == ";":
            if blocks and blocks[-1]:
                yield start, offset + 1
        elif character != ":" or not LABEL.match(head):
            continue
        if character != "{" or blocks[-1] is not None:
            start = -1


def _without_control(code: str, start: int) -> int:
    """Return the start of a statement behind `if (...)`, `else` and the like."""
    while match := CONTROL.match(code, start):
        start = _closing(code, match.end() - 1) if match[0].endswith("(") else match.end()
        start += len(code[start:]) - len(code[start:].lstrip())
    return start
