"""Read the hazards of the safety case, the attacks of the security page, and the tests that they name."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
HEAD = re.compile(r"\| no\. \| (?:hazard|attack)")
TESTS = re.compile(r"((?:`test_\w+`(?:, )?)+) in `(tests/[\w/]+\.py)`")


def table_rows(lines: list[str]) -> list[list[str]]:
    """Return the cells of each row of the table whose head is the first line."""
    end = next((i for i, line in enumerate(lines) if not line.startswith("|")), len(lines))
    return [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in lines[2:end]]


def hazards(page: str) -> dict[str, str]:
    """Return the hazards or attacks of a page by their number; raise ValueError if two have the same."""
    lines = (ROOT / "docs" / "explanation" / f"{page}.md").read_text(encoding="utf-8").splitlines()
    rows = [row for i, line in enumerate(lines) if HEAD.match(line) for row in table_rows(lines[i:])]
    found = {number: hazard for number, hazard, *_ in rows}
    if len(found) != len(rows):
        raise ValueError(f"{page}.md: two rows have the same number")
    return found


def named_tests(page: str) -> dict[str, list[str]]:
    """Return the tests that a page names for each number, as pytest takes them: `FILE::TEST`."""
    lines = (ROOT / "docs" / "explanation" / f"{page}.md").read_text(encoding="utf-8").splitlines()
    named: dict[str, list[str]] = {}
    for number, cell in table_rows(lines[lines.index("| no. | tests |") :]):
        found = [(file, test) for tests, file in TESTS.findall(cell) for test in re.findall(r"\w+", tests)]
        if number in named or len(found) != cell.count("`test_"):
            raise ValueError(f"{page}.md: {number} of the tests: named twice, or not '`test_x` in `FILE`'")
        named[number] = [f"{file}::{test}" for file, test in found]
    return named
