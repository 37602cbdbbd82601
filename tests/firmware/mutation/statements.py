"""Finds statements and conditions in C++, and names the mutants that change them."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator

from tests.firmware.mutation.mutants import Mutant

NOT_CODE = re.compile(r"//.*|^[ ]*#.*|\"(?:\\.|[^\"\\])*\"", re.MULTILINE)
NO_BODY = re.compile(r"(class|struct|enum|namespace)\b|extern\s*$")
INITIALIZER = re.compile(r"[=\]]\s*$")
LABEL = re.compile(r"(case\b.*|default|public|private)$", re.DOTALL)
CONTROL = re.compile(r"(?:else\s+)?(?:if|for|while|switch)\s*\(|else\s+|do\s+")
KEPT = re.compile(
    r"(using|static_assert|constexpr|const|static|typedef|template|extern)\b|return |__builtin"
    r"|__asm__ volatile\(\s*\n|[\w:<>]+[*&]? \w+( =|[,;]|\[)"
)
"""Declarations, values that are returned, and assembly, whose instructions are removed one by one."""
CONDITION = re.compile(r"\b(?:if|while) (?=\()")

Change = tuple[int, str, str]
"""Offset in the file, old and new text."""


def code_of(text: str) -> str:
    """Return the text with blanks instead of comments, strings and lines of the preprocessor."""
    return NOT_CODE.sub(lambda match: " " * len(match[0]), text)


def removed_statements(text: str, code: str) -> Iterator[Change]:
    """Yield the removal of each simple statement; `code` is the text with blanks where nothing is removed."""
    for start, end in _statements(code):
        simple = _without_control(code, start)
        # A condition before it is made false.
        if not CONDITION.match(code, start) and not KEPT.match(text, simple) and end > simple + 1:
            yield simple, text[simple:end], ";"


def named(file: str, text: str, changes: Iterable[Change]) -> Iterator[Mutant]:
    """Yield the mutants of these changes of a file, in the order of their places."""
    seen = Counter[str]()
    for offset, old, new in sorted(set(changes)):
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


def closing(code: str, start: int) -> int:
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
    for offset, character in enumerate(code.replace("::", "__")):
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
        start = closing(code, match.end() - 1) if match[0].endswith("(") else match.end()
        start += len(code[start:]) - len(code[start:].lstrip())
    return start
