"""The dashboard draws what the pictures draw in the same colours, and different things in different ones."""

import colorsys
import re
from pathlib import Path

import pytest

from thumper.common.colours import (
    BLUE,
    FREE_COLOUR,
    GREY,
    OCCUPIED_COLOUR,
    ORANGE,
    PURPLE,
    RED,
    UNKNOWN_COLOUR,
)
from thumper.dashboard.widgets import STATIC

SAME_DEG, DIFFERENT_DEG = 20.0, 30.0


ROOT = Path(__file__).parents[2]
ROBOT_STYLE = ROOT / "hil/browser/page/style.css"


def colours_of(style: str, scheme: str) -> dict[str, str]:
    block = style[style.index(f"{scheme} {{") :].partition("}")[0]
    return dict(re.findall(r"--(?:tp|robot)-([a-z-]+): (#[0-9a-f]{6})", block))


def test_dashboard_and_site_share_one_logo() -> None:
    assert (STATIC / "icon.svg").read_bytes() == (ROOT / "docs/images/logo.svg").read_bytes()


def test_pages_and_pictures_share_one_table() -> None:
    page = colours_of((STATIC / "style.css").read_text(encoding="utf-8"), ":root")
    robot = colours_of(ROBOT_STYLE.read_text(encoding="utf-8"), "#robot")
    table = {"plan": ORANGE, "goal": ORANGE, "scan": RED, "speed": BLUE, "setpoint": GREY}
    table |= {"keepout": PURPLE}
    table |= {"map-unknown": UNKNOWN_COLOUR, "map-free": FREE_COLOUR, "map-wall": OCCUPIED_COLOUR}
    assert {name: page[name] for name in table} == table
    table = {"scan": RED, "robot": BLUE, "left": BLUE}
    assert {name: robot[name] for name in table} == table


def hue_deg(colour: str) -> float:
    red, green, blue = (int(colour[n : n + 2], 16) / 255.0 for n in (1, 3, 5))
    return 360.0 * colorsys.rgb_to_hsv(red, green, blue)[0]


def differs_deg(one: str, other: str) -> float:
    turn = abs(hue_deg(one) - hue_deg(other))
    return min(turn, 360.0 - turn)


@pytest.mark.parametrize("scheme", [":root", "body.body--dark"])
def test_plan_scan_and_path_have_the_colours_of_the_pictures(scheme: str) -> None:
    style = (STATIC / "style.css").read_text(encoding="utf-8")
    colours = colours_of(style, scheme)
    for name, picture in (("plan", ORANGE), ("goal", ORANGE), ("scan", RED), ("trail", BLUE)):
        assert differs_deg(colours[name], picture) < SAME_DEG, name
    for name in ("plan", "scan", "trail", "particles"):
        assert name == "plan" or differs_deg(colours[name], colours["plan"]) > 0.5 * DIFFERENT_DEG, name
        assert differs_deg(colours[name], colours["keepout"]) > DIFFERENT_DEG, name
