"""The reference explains every navigation option: its effect, and its unit if the name has one."""

import re
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest

from thumper.navigation.options import NavigationOptions

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "options.md"
UNITS = {  # by the end of a name, the longest that fits
    "_m": "m",
    "_s": "s",
    "_rad": "rad",
    "_m_s": "m/s",
    "_rad_s": "rad/s",
    "_m_s2": "m/s^2",
    "_rad_s2": "rad/s^2",
    "_per_m": "1/m",
    "_m_per_rad": "m/rad",
    "_percent": "percent",
}


def tables() -> dict[str, Any]:
    """Return every table of the TOML with its options."""
    usual = NavigationOptions()
    parts = {f"[navigation.{f.name}]": getattr(usual, f.name) for f in fields(usual)}
    return {"[navigation]": usual} | {name: part for name, part in parts.items() if is_dataclass(part)}


def effects(table: str) -> dict[str, str]:
    """Return the effect that the page gives for each option of a table."""
    section = PAGE.read_text(encoding="utf-8").split(f"## {table}\n")[1].split("\n## ")[0]
    return dict(re.findall(r"^\| `(\w+)` \|.*\| ([^|]*) \|$", section, re.MULTILINE))


@pytest.mark.parametrize("table", tables())
def test_every_option_is_explained_with_its_unit(table: str) -> None:
    options = tables()[table]
    explained = effects(table)
    names = [field.name for field in fields(options) if not is_dataclass(getattr(options, field.name))]
    assert list(explained) == names
    for name in names:
        assert explained[name], name
        ends = [end for end in UNITS if name.endswith(end)]
        if ends:
            assert f"\\[{UNITS[max(ends, key=len)]}]" in explained[name], name
