"""Gains against closed forms, published figures and the fixed-point format."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from thumper.common.errors import ThumperError
from thumper_tuning.cli.gains_file import read_gains_file
from thumper_tuning.design.fixed_point import PARAMETER_SPECS, to_fixed_point
from thumper_tuning.design.gains import DesignOptions, design, nominal_model
from thumper_tuning.design.loop_analysis import (
    Plant,
    loop_margins,
    step_info,
    step_response,
    transfer_functions,
)
from thumper_tuning.design.tuning_rules import RULES, PiGains, migo, pole_placement
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.motor import IdentifiedMotor
from thumper_tuning.logs.motor_log import DriveUnit
from thumper_tuning.report.text import design_lines

MODEL = MotorModel(gain=0.0584, time_constant_s=0.075, friction_forward=19.3, friction_backward=19.3)
EXACT = Uncertainty(
    gain=0.0, time_constant_s=0.0, friction=0.0, delay_s=0.0, friction_forward=0.0, friction_backward=0.0
)


def test_the_default_design_meets_its_specification() -> None:
    result = design(MODEL, EXACT, DesignOptions())
    assert result.margins.max_sensitivity <= 1.65
    assert result.worst_case.max_sensitivity <= 2.0
    assert result.step_info.settling_time_s <= 0.5 + 1e-9
    assert result.step_info.overshoot_percent <= 10.0


@pytest.mark.parametrize(("ratio", "ki"), [(0.5, 0.70), (1.0, 0.63), (2.0, 0.64), (3.0, 0.69)])
def test_migo_agrees_with_the_table_of_normalized_gains(ratio: float, ki: float) -> None:
    """Ki K for Ms 1.6 over tau/T, computed independently; ours gives up 3 % of it for damping."""
    model = MotorModel(gain=1.0, time_constant_s=ratio, friction_forward=0.0, friction_backward=0.0)
    gains = migo(Plant.from_model(model, 1.0), 1.6)
    assert gains.ki == pytest.approx(0.97 * ki, rel=0.04)
    assert loop_margins(Plant.from_model(model, 1.0), gains.kp, gains.ki).max_sensitivity <= 1.6 + 1e-6


def test_no_loop_within_the_limit_has_a_larger_ki() -> None:
    plant = Plant.from_model(MODEL, 0.1)
    best = migo(plant, 1.6).ki / 0.97
    others = [loop_margins(plant, kp, 1.01 * best).max_sensitivity for kp in np.linspace(0.0, 30.0, 61)]
    assert min(others) > 1.6


def test_margins_agree_with_python_control() -> None:
    import control

    plant = Plant.from_model(MODEL, 0.1)
    margins = loop_margins(plant, 6.0, 10.0)
    P, C = transfer_functions(plant, 6.0, 10.0)
    gain_margin, phase_margin, _, *_ = control.margin(P * C)
    assert margins.gain_margin == pytest.approx(gain_margin, rel=0.05)
    assert margins.phase_margin_deg == pytest.approx(phase_margin, abs=2.0)
    closed = control.feedback(P * C, 1)
    _, y = control.step_response(closed, 2.0)
    assert step_response(plant, 6.0, 10.0, 20) == pytest.approx(y[:21], abs=1e-9)


def test_the_control_law_integrates_before_it_acts() -> None:
    """The first response to a unit error is Kp + Ki."""
    plant = Plant(pole=0.0, numerator=(1.0,), period_s=0.1)
    assert step_response(plant, 0.2, 0.1, 2)[:2] == pytest.approx([0.0, 0.3])


def test_pole_placement_places_the_pair() -> None:
    plant = Plant.from_model(MODEL, 0.1)
    gains = pole_placement(plant, 8.0, 0.8)
    pair = np.exp(0.1 * 8.0 * complex(-0.8, 0.6))
    residual = 1.0 + plant.response(np.array([pair]))[0] * (gains.kp + gains.ki * pair / (pair - 1.0))
    assert abs(residual) < 1e-9


@pytest.mark.parametrize("rule", RULES)
def test_every_rule_gives_a_stable_loop(rule: str) -> None:
    result = design(MODEL, EXACT, DesignOptions(rule=rule))
    assert result.margins.stable
    assert math.isfinite(result.margins.max_sensitivity)


def test_gains_are_rounded_to_fixed_point_and_rejected_out_of_range() -> None:
    gains = to_fixed_point(kp=6.0123456, ki=10.1, ks=19.3, kv=17.1, ka=1.28, acceleration=8.0)
    for name, value in gains.items():
        assert value * PARAMETER_SPECS[name].scale == pytest.approx(gains.wire_values()[name], abs=1e-9)
    with pytest.raises(ThumperError, match="kp = 61"):
        to_fixed_point(kp=61.0, ki=1.0)


def test_manual_gains_are_evaluated_not_changed() -> None:
    result = design(MODEL, EXACT, DesignOptions(manual=PiGains(kp=15.0, ki=0.5)))
    assert (result.gains.kp, result.gains.ki) == pytest.approx((15.0, 0.5), abs=0.001)
    with pytest.raises(ThumperError, match="unstable"):
        design(MODEL, EXACT, DesignOptions(manual=PiGains(kp=59.0, ki=29.0)))


def test_a_slow_loop_settles_late() -> None:
    plant = Plant.from_model(MODEL, 0.1)
    assert step_info(plant, 4.0, 1.5).settling_time_s > step_info(plant, 6.0, 10.9).settling_time_s


@pytest.mark.parametrize("text", ["", "{}", '{"gains": {"kp": 1.0}}', '{"gains": {"kp": "fast"}}', "[1]"])
def test_a_file_without_all_gains_is_rejected_in_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "gains.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ThumperError, match="not have all of kp, ki, ks, kv, ka, acceleration") as rejected:
        read_gains_file(path)
    assert rejected.value.exit_code == 2


def test_a_small_worst_case_margin_gives_a_warning() -> None:
    known = SimpleNamespace(unit=DriveUnit.PWM, model=MODEL, uncertainty=EXACT, supply_V=7.4)
    motor = cast("IdentifiedMotor", known)
    for ms, warns in ((1.6, True), (1.15, False)):
        options = DesignOptions(period_s=0.01, largest_sensitivity=ms)
        result = design(*nominal_model([motor]), options)
        assert (result.worst_case.max_sensitivity > 2.0) is warns
        assert ("near to ringing" in "\n".join(design_lines(result))) is warns
