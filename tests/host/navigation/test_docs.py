"""docs/navigation.md lists every option as the code has it: default, range, unit and effect."""

import inspect
from dataclasses import fields, is_dataclass
from itertools import chain
from pathlib import Path
from typing import Any, get_type_hints

import pytest
from annotated_types import Ge, Gt, Interval, Le, Lt

from thumper.navigation.options import NavigationOptions

PAGE = Path(__file__).resolve().parents[3] / "docs" / "navigation.md"
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
    """Every table of the TOML with its options."""
    usual = NavigationOptions()
    parts = {f"[navigation.{f.name}]": getattr(usual, f.name) for f in fields(usual)}
    return {"[navigation]": usual} | {name: part for name, part in parts.items() if is_dataclass(part)}


def rows(table: str) -> dict[str, tuple[str, str, str]]:
    """What the page says of each option of a table: default, range, unit and effect."""
    section = PAGE.read_text().split(f"### `{table}`")[1].split("\n### ")[0]
    cells = [[cell.strip() for cell in row.split("|")] for row in section.splitlines() if row[:3] == "| `"]
    return {row[1].strip("`"): (row[2], row[3], row[4]) for row in cells}


@pytest.mark.parametrize("table", tables())
def test_every_option_is_documented_with_default_range_and_unit(table: str) -> None:
    options = tables()[table]
    hints = get_type_hints(type(options), include_extras=True)
    told, comments = rows(table), _comments(type(options))
    expected = [field.name for field in fields(options) if not is_dataclass(getattr(options, field.name))]
    assert list(told) == expected
    for name in expected:
        default, span, effect = told[name]
        assert _plain(default) == _plain(str(getattr(options, name))), name
        assert span == _span(getattr(hints[name], "__metadata__", ())), name
        assert effect == comments[name]
        ends = [end for end in UNITS if name.endswith(end)]
        if ends:
            assert f"[{UNITS[max(ends, key=len)]}]" in effect, name


def test_ranges_are_written_as_one_reads_them() -> None:
    assert _span((Gt(0),)) == "> 0"
    assert _span((Ge(2),)) == "≥ 2"
    assert _span((Interval(gt=0, le=1),)) == "> 0 … 1"
    assert _span((Ge(0), Lt(1))) == "0 … < 1"
    assert _span(()) == ""


def _span(limits: tuple[object, ...]) -> str:
    """A range in words of the page."""
    low = high = ""
    for limit in chain.from_iterable(part if isinstance(part, Interval) else [part] for part in limits):
        if isinstance(limit, Gt):
            low = f"> {limit.gt:g}"
        elif isinstance(limit, Ge):
            low = f"{limit.ge:g}"
        elif isinstance(limit, Lt):
            high = f"< {limit.lt:g}"
        elif isinstance(limit, Le):
            high = f"{limit.le:g}"
    if high:
        return f"{low} … {high}"
    return low if not low or low.startswith(">") else f"≥ {low}"


def _comments(options: type) -> dict[str, str]:
    """The comment above each field, in one line."""
    comments: dict[str, str] = {}
    above: list[str] = []
    for line in map(str.strip, inspect.getsource(options).splitlines()):
        if line.startswith("# "):
            above.append(line[2:])
        elif above:
            comments[line.split(":")[0]], above = " ".join(above), []
    return comments


def _plain(text: str) -> str | float:
    try:
        return float(text)
    except ValueError:
        return text
