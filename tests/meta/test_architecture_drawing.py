"""The drawing of the packages: no arrow runs behind a box, and no description is cut off."""

import re
from pathlib import Path

import numpy as np
import pytest
from scripts import draw_architecture

DRAWING = Path(__file__).parents[2] / "docs" / "images" / "architecture.svg"
BOX = re.compile(r'<rect x="(\d+)" y="(\d+)" width="(\d+)" height="(\d+)" rx')
CURVE = re.compile(r" C(\d+) (\d+) (\d+) (\d+) (\d+) (\d+)(?: V(\d+))?")


def test_no_arrow_runs_behind_a_box() -> None:
    text = DRAWING.read_text(encoding="utf-8")
    boxes = np.array(BOX.findall(text), dtype=float)
    t = np.linspace(0.0, 1.0, 50)[:, None]
    arrows = re.findall(r'<path d="M(\d+) (\d+)( C[^"]*)"', text)
    assert len(arrows) > 20
    for x, y, curves in arrows:
        start = np.array([x, y], dtype=float)
        for *numbers, down in CURVE.findall(curves):
            one, two, end = np.array(numbers, dtype=float).reshape(3, 2)
            points = (1 - t) ** 3 * start + 3 * (1 - t) ** 2 * t * one + 3 * (1 - t) * t**2 * two + t**3 * end
            start = np.array([end[0], float(down or end[1])])
            points = np.vstack((points, end + t * (start - end)))[:, None]
            inside = (points > boxes[:, :2] + 1) & (points < boxes[:, :2] + boxes[:, 2:] - 1)
            assert not inside.all(axis=2).any(), (x, y, curves)


def test_description_that_needs_three_lines_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(draw_architecture, "purpose", lambda _name: "word " * 20)
    with pytest.raises(ValueError, match="shorten the first sentence"):
        draw_architecture.draw()
