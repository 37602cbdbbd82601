"""Gains against closed forms, published figures and the wire."""

import io
import math
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from rich.console import Console

from thumper.common.errors import ThumperError
from thumper_tuning.cli.steps import design_for, read_gains_file
from thumper_tuning.design.fixed_point import SPECS, on_the_wire
from thumper_tuning.design.gains import DesignOptions, design
from thumper_tuning.design.loop_analysis import Plant, judge, judge_step, step_response, transfer
from thumper_tuning.design.tuning_rules import RULES, PiGains, migo, pole_placement
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.motor import Identified
from thumper_tuning.logs.motor_log import DriveUnit

MODEL = MotorModel(gain=0.0584, time_constant_s=0.075, friction_forward=19.3, friction_backward=19.3)
SURE = Uncertainty(
    gain=0.0, time_constant_s=0.0, friction=0.0, delay_s=0.0, friction_forward=0.0, friction_backward=0.0
)


def test_the_default_meets_its_promises() -> None:
    result = design(MODEL, SURE, DesignOptions())
    assert result.loop.sensitivity <= 1.65
    assert result.worst.sensitivity <= 2.0
    assert result.step.settle_s <= 0.5 + 1e-9
    assert result.step.overshoot_percent <= 10.0


@pytest.mark.parametrize(("ratio", "ki"), [(0.5, 0.70), (1.0, 0.63), (2.0, 0.64), (3.0, 0.69)])
def test_migo_agrees_with_the_table_of_normalised_gains(ratio: float, ki: float) -> None:
    """Ki K of Ms 1.6 for tau/T, computed apart from this code; ours gives 3 % of it away for damping."""
    model = MotorModel(gain=1.0, time_constant_s=ratio, friction_forward=0.0, friction_backward=0.0)
    gains = migo(Plant.of(model, 1.0), 1.6)
    assert gains.ki == pytest.approx(0.97 * ki, rel=0.04)
    assert judge(Plant.of(model, 1.0), gains.kp, gains.ki).sensitivity <= 1.6 + 1e-6


def test_no_loop_within_the_limit_has_a_larger_ki() -> None:
    plant = Plant.of(MODEL, 0.1)
    best = migo(plant, 1.6).ki / 0.97
    rivals = [judge(plant, kp, 1.01 * best).sensitivity for kp in np.linspace(0.0, 30.0, 61)]
    assert min(rivals) > 1.6


def test_margins_agree_with_python_control() -> None:
    import control

    plant = Plant.of(MODEL, 0.1)
    figures = judge(plant, 6.0, 10.0)
    P, C = transfer(plant, 6.0, 10.0)
    gain_margin, phase_margin, _, *_ = control.margin(P * C)
    assert figures.gain_margin == pytest.approx(gain_margin, rel=0.05)
    assert figures.phase_margin_deg == pytest.approx(phase_margin, abs=2.0)
    closed = control.feedback(P * C, 1)
    _, y = control.step_response(closed, 2.0)
    assert step_response(plant, 6.0, 10.0, 20) == pytest.approx(y[:21], abs=1e-9)


def test_the_boards_law_integrates_before_it_acts() -> None:
    """First answer to a unit error is Kp + Ki: read off the loop's first samples."""
    plant = Plant(pole=0.0, taps=(1.0,), period_s=0.1)
    assert step_response(plant, 0.2, 0.1, 2)[:2] == pytest.approx([0.0, 0.3])


def test_pole_placement_puts_the_pair() -> None:
    plant = Plant.of(MODEL, 0.1)
    gains = pole_placement(plant, 8.0, 0.8)
    pair = np.exp(0.1 * 8.0 * complex(-0.8, 0.6))
    residual = 1.0 + plant.response(np.array([pair]))[0] * (gains.kp + gains.ki * pair / (pair - 1.0))
    assert abs(residual) < 1e-9


@pytest.mark.parametrize("rule", RULES)
def test_every_rule_gives_a_stable_loop(rule: str) -> None:
    result = design(MODEL, SURE, DesignOptions(rule=rule))
    assert result.loop.stable
    assert math.isfinite(result.loop.sensitivity)


def test_gains_lie_on_the_wires_grid_and_refuse_what_does_not_fit() -> None:
    gains = on_the_wire(kp=6.0123456, ki=10.1, ks=19.3, kv=17.1, ka=1.28, acceleration=8.0)
    for name, value in gains.items():
        assert value * SPECS[name].scale == pytest.approx(gains.integers()[name], abs=1e-9)
    with pytest.raises(ThumperError, match="kp = 61"):
        on_the_wire(kp=61.0, ki=1.0)


def test_manual_gains_are_judged_not_changed() -> None:
    result = design(MODEL, SURE, DesignOptions(manual=PiGains(kp=15.0, ki=0.5)))
    assert (result.gains.kp, result.gains.ki) == pytest.approx((15.0, 0.5), abs=0.001)
    with pytest.raises(ThumperError, match="unstable"):
        design(MODEL, SURE, DesignOptions(manual=PiGains(kp=59.0, ki=29.0)))


def test_a_slow_loop_settles_late() -> None:
    plant = Plant.of(MODEL, 0.1)
    assert judge_step(plant, 4.0, 1.5).settle_s > judge_step(plant, 6.0, 10.9).settle_s


@pytest.mark.parametrize("text", ["", "{}", '{"gains": {"kp": 1.0}}', '{"gains": {"kp": "fast"}}', "[1]"])
def test_a_file_without_all_gains_is_refused_in_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "gains.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ThumperError, match="not each of kp, ki, ks, kv, ka, acceleration") as refused:
        read_gains_file(path)
    assert refused.value.exit_code == 2


def test_a_loop_that_another_load_brings_near_to_ringing_is_named() -> None:
    said = io.StringIO()
    known = SimpleNamespace(unit=DriveUnit.PWM, model=MODEL, uncertainty=SURE, supply_V=7.4)
    motor = cast("Identified", known)
    for ms, noted in ((1.6, True), (1.15, False)):
        said.seek(0)
        said.truncate()
        options = DesignOptions(period_s=0.01, largest_sensitivity=ms)
        result = design_for([motor], options, None, Console(file=said, width=200))
        assert (result.worst.sensitivity > 2.0) is noted
        assert ("near to ringing" in said.getvalue()) is noted
