"""The dashboard draws what the pictures draw in the same colours, and different things in different ones."""

import colorsys
import re

import pytest

from thumper.dashboard.widgets import STATIC
from thumper.maps.plot import BLUE, ORANGE, RED

SAME_DEG, DIFFERENT_DEG = 20.0, 30.0


def hue_deg(colour: str) -> float:
    red, green, blue = (int(colour[n : n + 2], 16) / 255.0 for n in (1, 3, 5))
    return 360.0 * colorsys.rgb_to_hsv(red, green, blue)[0]


def differs_deg(one: str, other: str) -> float:
    turn = abs(hue_deg(one) - hue_deg(other))
    return min(turn, 360.0 - turn)


@pytest.mark.parametrize("scheme", [":root", "body.body--dark"])
def test_plan_scan_and_path_have_the_colours_of_the_pictures(scheme: str) -> None:
    style = (STATIC / "style.css").read_text(encoding="utf-8")
    block = style[style.index(f"{scheme} {{") :].partition("}")[0]
    colours = dict(re.findall(r"--tp-([a-z-]+): (#[0-9a-f]{6})", block))
    for name, picture in (("plan", ORANGE), ("goal", ORANGE), ("scan", RED), ("trail", BLUE)):
        assert differs_deg(colours[name], picture) < SAME_DEG, name
    for name in ("plan", "scan", "trail", "particles"):
        assert name == "plan" or differs_deg(colours[name], colours["plan"]) > 0.5 * DIFFERENT_DEG, name
        assert differs_deg(colours[name], colours["keepout"]) > DIFFERENT_DEG, name
