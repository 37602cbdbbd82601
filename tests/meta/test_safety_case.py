"""Each hazard of the safety case and each attack of the security page names a test that exists."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = {"safety": 30, "security": 20}  # with the least number of rows
HEADS = ("| hazard", "| attack")


def rows(page: str) -> list[str]:
    """Return the rows of the page's tables that end with a test."""
    text = (ROOT / "docs" / "explanation" / f"{page}.md").read_text(encoding="utf-8")
    sections = text.partition("## Assets")[2].partition("\n## The bus")[2] or text  # behind the attackers
    return [line for line in sections.splitlines() if line.startswith("| ") and not line.startswith(HEADS)]


@pytest.mark.parametrize("page", PAGES)
def test_every_hazard_has_a_test_that_exists(page: str) -> None:
    assert len(rows(page)) > PAGES[page]
    for row in rows(page):
        named = re.findall(r"`(tests/[\w/]+\.py)::(test_\w+)`", row)
        assert named, row
        for file, test in named:
            assert f"\ndef {test}(" in (ROOT / file).read_text(encoding="utf-8"), f"{file}::{test}"
