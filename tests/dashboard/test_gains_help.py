"""The drawing and text beside the gains: equal to python-control's figures, and live on the page."""

import math
import re
from typing import Literal

import numpy as np
import pytest
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import until
from playwright.sync_api import Page, expect

from tests.page_checks import POOR
from thumper.board.messages import PARAMETERS
from thumper.dashboard.board_parameters import DOCS
from thumper.dashboard.gains_help import EFFECTS, NO_MODEL, gains_help, gains_warning
from thumper.dashboard.gains_panel import CHOICES, GROUPS
from thumper.dashboard.loop_response import PERIOD_S, loop_response
from thumper_tuning.design.loops import SpeedLoop
from thumper_tuning.design.plant import Plant
from thumper_tuning.identify.model import MotorModel

VALUES = {"kp": 6.1, "ki": 10.9, "kv": 17.12, "ka": 1.284}


@pytest.mark.parametrize(
    ("kp", "ki", "kv", "ka"),
    [
        (6.1, 10.9, 17.12, 1.284),
        (3.0, 2.0, 17.12, 5.0),
        (20.0, 6.0, 10.0, 0.3),
        (0.0, 8.0, 17.0, 2.0),
        (40.0, 30.0, 17.0, 1.0),
    ],
)
def test_the_figures_are_those_of_python_control(kp: float, ki: float, kv: float, ka: float) -> None:
    model = MotorModel(gain=1.0 / kv, time_constant_s=ka / kv, friction_forward=0.0, friction_backward=0.0)
    loop = SpeedLoop.of_board(Plant.from_model(model, PERIOD_S), kp, ki)
    ours = loop_response(kp=kp, ki=ki, kv=kv, ka=ka)
    assert ours.stable == loop.is_stable()
    if not ours.stable:
        return
    margins, info = loop.margins(), loop.step_info()
    assert ours.phase_margin_deg == pytest.approx(margins.phase_margin_deg, abs=0.1)
    assert ours.gain_margin == pytest.approx(margins.gain_margin, rel=0.01)
    assert ours.sensitivity_peak == pytest.approx(margins.max_sensitivity, rel=0.01)
    ticks = len(ours.step) - 1
    assert ours.step == pytest.approx(np.ravel(loop.step_response(ticks).outputs), abs=1e-9)
    assert ours.rise_time_s == pytest.approx(info.rise_time_s)
    assert ours.overshoot_percent == pytest.approx(info.overshoot_percent, abs=0.1)


def test_the_table_has_margins_and_what_more_gain_does() -> None:
    drawing, table, warning = gains_help(VALUES, VALUES)
    assert warning == ""
    assert drawing.count("<svg") == 3
    assert drawing.count("class='edited'") == drawing.count("class='used'") == 3
    assert "<td>11.2\N{NO-BREAK SPACE}dB</td><td>1.60</td>" in table
    assert [drawing.count(f">{rate}<") for rate in (0.1, 3, 30)] == [2, 2, 2]
    now, more_kp, more_ki = (float(found) for found in re.findall(r"<td>(\d+)°", table))
    assert more_ki < now
    assert more_kp != now
    assert re.findall(r"<tr><th>([^<]+)", table) == [
        "now",
        "kp +20\N{NO-BREAK SPACE}%",
        "ki +20\N{NO-BREAK SPACE}%",
    ]
    _, table, warning = gains_help({**VALUES, "kp": 60.0, "ki": 30.0}, VALUES)
    assert table == ""
    assert "Unstable" in warning


def test_gains_close_to_instability_are_a_warning() -> None:
    assert gains_warning(VALUES) == gains_warning({**VALUES, "kv": 0.0}) == ""
    risky = {**VALUES, "kp": 36.0}
    assert re.match(r"Close to unstable: Ms is \d\.\d\d, above 2\.", gains_warning(risky))
    _, table, warning = gains_help(risky, VALUES)
    assert warning == gains_warning(risky)
    assert "<td>under 0.1 s</td>" in table  # within one tick
    assert gains_warning({**VALUES, "kp": 60.0, "ki": 30.0}).startswith("Unstable")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_panel_warns_of_gains_close_to_instability(page: Page, scheme: Literal["light", "dark"]) -> None:
    page.emulate_media(color_scheme=scheme)
    page.click(".tp-tab-gains")
    text, message = page.locator(".tp-gainshelp p"), page.locator(".tp-message:visible")
    expect(page.locator(".tp-margins")).to_contain_text("phase margin")
    expect(text).not_to_have_class("warn")
    page.locator("[data-gain=kp]").fill("36")
    expect(text).to_have_class("warn")
    page.locator(".q-tab-panel button", has_text="Apply").click()
    expect(message).to_contain_text("The board now uses kp 36. Close to unstable: Ms is")
    expect(message).to_have_class(re.compile("warn"))
    expect(message).not_to_have_class(re.compile("good"))
    assert page.evaluate(POOR) == []
    page.locator("[data-gain=kp]").fill("6.1")
    expect(text).not_to_have_class("warn")


@pytest.mark.parametrize("changed", [{"kv": 0.0}, {"ka": 0.0}, {"kp": None}, {"kp": math.nan}])
def test_without_a_model_it_says_so(changed: dict[str, float]) -> None:
    assert gains_help({**VALUES, **changed}, VALUES) == ("", "", NO_MODEL)


def test_each_parameter_is_explained_beside_its_slider(page: Page) -> None:
    page.click(".tp-tab-gains")
    expect(page.locator(".tp-gaintext")).to_have_count(len(DOCS))
    expect(page.locator(".tp-gaintext").first).to_have_text(EFFECTS["kp"])
    expect(page.locator(".tp-gain small", has_text="rad/s²")).to_have_count(3)
    assert all(page.locator(".tp-gaintext").all_inner_texts())


def test_what_has_few_values_is_chosen_from_a_list(page: Page, robot: FakeRobot) -> None:
    page.click(".tp-tab-gains")
    choice = page.locator(".tp-number:has([data-gain=input_1])")
    expect(choice).to_be_hidden()
    page.get_by_role("button", name="Inputs and sensors").click()
    choice.click()
    page.get_by_role("option", name="1: stops while low").click()
    page.locator(".q-tab-panel button", has_text="Apply").click()
    until(lambda: robot.parameters["input_1"] == 1.0)


def test_each_parameter_has_one_group() -> None:
    grouped = [name for names in GROUPS.values() for name in names]
    assert len(grouped) == len(set(grouped))
    assert set(grouped) | {"kp", "ki", "ks", "kv", "ka", "acceleration", "deceleration"} == set(DOCS)
    assert {spec.name for spec in PARAMETERS if spec.scale == 1.0 and spec.maximum <= 2.0} == set(CHOICES)


def test_a_slider_changes_drawing_and_text(page: Page, robot: FakeRobot) -> None:
    page.click(".tp-tab-gains")
    text = page.locator(".tp-margins")
    expect(text).to_contain_text("phase margin")
    before = text.inner_text()
    curve = "document.querySelector('.tp-loop polyline.edited').getAttribute('points')"
    points = page.evaluate(curve)
    page.locator("[data-gain=ki]").fill("3")
    expect(text).not_to_have_text(before)
    page.wait_for_function(f"{curve} !== {points!r}")
    assert page.evaluate(curve.replace("edited", "used")) == points  # what the board uses


def test_a_value_out_of_range_is_neither_judged_nor_applied(page: Page, robot: FakeRobot) -> None:
    page.click(".tp-tab-gains")
    apply = page.locator(".q-tab-panel button", has_text="Apply")
    undo = page.locator(".q-tab-panel button", has_text="Undo")
    text = page.locator(".tp-gainshelp p")
    table = page.locator(".tp-margins table")
    expect(table).to_be_visible()
    page.locator("[data-gain=kp]").fill("99999")
    expect(text).to_contain_text("kp must be 0 …")
    expect(page.locator(".tp-loop svg")).to_have_count(0)
    expect(table).to_have_count(0)
    expect(apply).to_be_disabled()
    expect(undo).to_be_enabled()
    page.locator("[data-gain=kp]").fill("7")
    expect(table).to_be_visible()
    expect(apply).to_be_enabled()
