"""The generated reference pages match the commands and the configuration."""

import re
import shutil
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import get_type_hints

import pytest

from tests.meta.freshness import check
from thumper.common.strict_toml import STATED
from thumper.config.robot import RobotConfig

ROOT = Path(__file__).parents[2]
GENERATE = ROOT / "scripts/generate_reference.py"
GENERATED = [
    ROOT / "scripts" / name
    for name in ("draw_architecture.py", "draw_badges.py", "python_reference.py", "render_notebooks.py")
]
REFERENCE = ROOT / "docs/reference"


def test_the_pages_are_fresh() -> None:
    result = check(GENERATE)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize("script", GENERATED, ids=lambda script: script.stem)
def test_drawings_and_notebooks_are_fresh(script: Path) -> None:
    result = check(script)
    assert result.returncode == 0, result.stdout + result.stderr


def test_check_finds_a_stale_page_and_keeps_it(tmp_path: Path) -> None:
    (tmp_path / "scripts").mkdir()
    script = tmp_path / "scripts" / GENERATE.name
    script.write_bytes(GENERATE.read_bytes())
    folder = tmp_path / "docs" / "reference"
    folder.mkdir(parents=True)
    (folder / "cli.md").write_bytes((REFERENCE / "cli.md").read_bytes())
    shutil.copytree(REFERENCE / "cli", folder / "cli")
    changed = (REFERENCE / "options.md").read_text(encoding="utf-8").replace("model", "modle")
    (folder / "options.md").write_text(changed, encoding="utf-8")

    result = check(script)

    assert result.returncode == 1
    assert "stale: docs/reference/options.md" in result.stdout
    assert "cli" not in result.stdout
    assert (folder / "options.md").read_text(encoding="utf-8") == changed


def keys_of(table: type, name: str = "") -> Iterator[tuple[str, str]]:
    """Yield every key of the robot's TOML with its table."""
    hints = get_type_hints(table)
    for field in fields(table):
        if is_dataclass(hints[field.name]):
            yield from keys_of(hints[field.name], f"{name}.{field.name}".lstrip("."))
        elif field.name != STATED:
            yield name, field.name


def test_reference_lists_every_key_under_its_table() -> None:
    sections = re.split(r"^## ", (REFERENCE / "options.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    rows = {
        (section.splitlines()[0].strip("[]").replace("Top level", ""), key)
        for section in sections[1:]
        for key in re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE)
    }
    assert rows == set(keys_of(RobotConfig))


def test_every_key_is_explained() -> None:
    reference = (REFERENCE / "options.md").read_text(encoding="utf-8")
    explained = set(re.findall(r"^\| `(\w+)` \|.*\| [^|]+ \|$", reference, re.MULTILINE))
    text = "\n".join(
        page.read_text(encoding="utf-8") for page in (ROOT / "docs").rglob("*.md") if page.parent != REFERENCE
    )
    words = set(re.findall(r"\w+", text))
    assert {key for _, key in keys_of(RobotConfig)} <= explained | words
