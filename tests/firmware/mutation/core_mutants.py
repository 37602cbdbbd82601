"""All mutants of firmware/core: an operator or constant changed, a statement removed, a condition false."""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from tests.firmware.mutation.mutants import CORE, OPERATORS, Mutant
from tests.firmware.mutation.statements import CONDITION, Change, closing, code_of, named, removed_statements

SKIPPED = {"messages.hpp"}  # generated, and another test compares it with the schema
TOKEN = re.compile(
    "|".join(sorted((re.escape(operator) for operator in OPERATORS), key=len, reverse=True))
    + r"|(?<![\w.])(?:0x[0-9A-Fa-f]+|\d+)(?=[uUlL]*\b)"
)
COMMENT = re.compile(r"//.*|^\s*#.*")


def core_mutants() -> list[Mutant]:
    """Return every mutant, in the order of files."""
    paths = [path for path in sorted(CORE.glob("*.hpp")) if path.name not in SKIPPED]
    return [mutant for path in paths for mutant in [*_of_tokens(path), *_of_statements(path)]]


def _of_statements(path: Path) -> Iterator[Mutant]:
    text = path.read_text(encoding="utf-8")
    return named(path.name, text, _removals(text))


def _removals(text: str) -> Iterator[Change]:
    code = code_of(text)
    for change in removed_statements(text, code):
        if not change[1].startswith("asm("):  # not compiled for the PC
            yield change
    for match in CONDITION.finditer(code):
        yield match.end(), text[match.end() : closing(code, match.end())], "(false)"


def _of_tokens(path: Path) -> Iterator[Mutant]:
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
