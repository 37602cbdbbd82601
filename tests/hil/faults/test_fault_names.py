"""Invalid scenarios are reported in one line, and the documentation names every fault."""

from pathlib import Path

import pytest

from thumper.board.board import Board
from thumper.common.errors import ThumperError
from thumper_hil.faults.catalogue import FAULTS

NAME = "fault-names"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('faults = [{ at_s = 1.0, encoder.left.c = "cut" }]', "unknown fault 'encoder.left.c'"),
        ('faults = [{ at_s = 1.0, encoder.left.b = "torn" }]', "encoder.left.b = 'torn': must be ok or cut"),
        ("faults = [{ at_s = 1.0, slip.left = 2.0 }]", "0...1"),
        ('faults = [{ at_s = "soon", lidar = "unplugged" }]', "at_s = 'soon'"),
        ("faults = [{ at_s = 1.0 }]", "no fault"),
        ("faults = [{ at_s = 1.0, robot.carried = [1, 2] }]", "heading_deg"),
        ("wishes = []", "unknown key wishes"),
        ("faults = [", "TOML|Invalid|Unclosed|array"),
    ],
)
def test_invalid_scenario_is_reported_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    scenario = tmp_path / "faults.toml"
    scenario.write_text(text)
    with pytest.raises(ThumperError, match=words) as caught:
        Board.open(f"sim://{NAME}-wrong/board?scenario={scenario}", baud=500_000)
    assert "faults.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_documentation_lists_every_fault() -> None:
    text = (Path(__file__).resolve().parents[3] / "docs" / "howto" / "bench.md").read_text()
    for name in FAULTS:
        family, _, rest = name.partition(".")
        short = {
            "encoder": "encoder.SIDE." + name.rpartition(".")[2],
            "motor": "motor.SIDE",
            "wheels": "wheels.SIDE",
            "slip": "slip.SIDE",
        }
        assert f"`{short.get(family, name)}`" in text, rest
