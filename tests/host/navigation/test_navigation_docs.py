"""docs/navigation.md lists every option with its default."""

from dataclasses import fields, is_dataclass
from pathlib import Path

from thumper.navigation.options import NavigationOptions

PAGE = Path(__file__).resolve().parents[3] / "docs" / "navigation.md"


def test_every_option_is_documented_with_its_default() -> None:
    text = PAGE.read_text()
    tables: dict[str, object] = {"[navigation]": NavigationOptions()}
    for field in fields(NavigationOptions):
        value = getattr(NavigationOptions(), field.name)
        if is_dataclass(value):
            tables[f"[navigation.{field.name}]"] = value
    assert len(tables) >= 9
    for name, options in tables.items():
        section = text.split(f"### `{name}`")[1].split("\n### ")[0]
        rows = {
            row.split("|")[1].strip(): row.split("|")[2].strip()
            for row in section.splitlines()
            if row[:3] == "| `"
        }
        expected = {
            f"`{field.name}`": str(getattr(options, field.name))
            for field in fields(options)  # type: ignore[arg-type]
            if not is_dataclass(getattr(options, field.name))
        }
        assert {key: _plain(value) for key, value in rows.items()} == {
            key: _plain(value) for key, value in expected.items()
        }


def _plain(text: str) -> str | float:
    try:
        return float(text)
    except ValueError:
        return text
