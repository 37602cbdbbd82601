"""The pages list every option of their tables with its default."""

from dataclasses import fields
from pathlib import Path

import pytest

from thumper.config.recording import RecordingOptions
from thumper.config.teleop import TeleopOptions

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize(
    ("page", "options"), [("howto/recording.md", RecordingOptions), ("howto/teleop.md", TeleopOptions)]
)
def test_page_lists_every_option_with_its_default(page: str, options: type) -> None:
    rows = {
        cells[1].strip("` "): cells[4].strip("` ")
        for line in (DOCS / page).read_text(encoding="utf-8").splitlines()
        if line.startswith("| `") and len(cells := line.split("|")) == 7
    }
    for field in fields(options):
        default = field.default
        assert rows[field.name] == (f'"{default}"' if isinstance(default, str) else f"{default:g}"), (
            field.name
        )
    assert len(rows) == len(fields(options))
