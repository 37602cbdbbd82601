"""The report's words about the effect of new gains."""

import re

import numpy as np
import pytest

from thumper_tuning.design.fixed_point import BoardGains, to_fixed_point
from thumper_tuning.design.gains import DesignOptions, design
from thumper_tuning.drive.verify import COLUMNS, TrackingError, Verification, tracking_error
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.report.page import BoardResults, verdict
from thumper_tuning.report.text import deciding_change, design_lines, is_better, tracking_change


def drive(std_rad_s: float, seed: int) -> TrackingError:
    """Return the tracking error of 130 ticks with a random error."""
    rows = np.zeros((130, len(COLUMNS)))
    rows[:, 2] = 1.0
    rows[:, [4, 7]] = np.random.default_rng(seed).normal(0.0, std_rad_s, (130, 2))
    return tracking_error(rows, 4.0)


def test_the_printed_gains_have_units() -> None:
    assert re.match(r"  kp +[\d.]+ PWM/\(rad/s\) +\(stored as \d+\)$", design_lines(DESIGN)[0])


def test_the_standard_error_is_the_spread_between_drives() -> None:
    found = [drive(0.1, seed) for seed in range(100)]
    spread = float(np.std([t.std_rad_s for t in found]))
    assert float(np.mean([t.std_error_rad_s for t in found])) == pytest.approx(spread, rel=0.25)


def test_noise_is_not_reported_as_an_effect() -> None:
    quiet = [tracking_change(drive(0.1, k), drive(0.1, k + 100)) for k in range(20)]
    assert sum("no change beyond the noise" in text for text in quiet) >= 17
    assert "noise" not in tracking_change(drive(0.1, 1), drive(0.2, 2))


MODEL = MotorModel(gain=0.0584, time_constant_s=0.075, friction_forward=19.3, friction_backward=19.3)
EXACT = Uncertainty(
    gain=0.0, time_constant_s=0.0, friction=0.0, delay_s=0.0, friction_forward=0.0, friction_backward=0.0
)
DESIGN = design(MODEL, EXACT, DesignOptions())


def verification(gains: BoardGains, *stds_rad_s: float) -> Verification:
    """Return drives with these tracking errors, one per ramp."""
    tracking = tuple(drive(std_rad_s, 1) for std_rad_s in stds_rad_s)
    return Verification(gains=gains, rows=np.zeros((0, len(COLUMNS))), tracking=tracking)


@pytest.mark.parametrize(
    ("before_rad_s", "after_rad_s", "better"),
    [
        ((0.1, 0.1), (0.1, 0.1), False),
        ((0.1, 0.1), (0.1, 0.05), True),
        ((0.1, 0.1), (0.2, 0.05), False),
        ((0.1, 0.1), (0.2, 0.2), False),
    ],
)
def test_gains_are_better_if_a_ramp_is_and_none_is_worse(
    before_rad_s: tuple[float, float], after_rad_s: tuple[float, float], better: bool
) -> None:
    before, after = verification(DESIGN.gains, *before_rad_s), verification(DESIGN.gains, *after_rad_s)
    assert is_better(before, after, DESIGN) is better


def test_the_result_has_the_ramp_that_decides() -> None:
    before, after = verification(DESIGN.gains, 0.1, 0.1), verification(DESIGN.gains, 0.2, 0.05)
    assert [deciding_change(before, after, better=better) for better in (True, False)] == [
        tracking_change(before.tracking[k], after.tracking[k]) for k in (1, 0)
    ]


def test_gains_that_are_less_sensitive_or_accelerate_otherwise_are_better() -> None:
    same = DESIGN.gains
    near_ringing = to_fixed_point(**{**dict(same.items()), "kp": 3.0 * same.kp})
    faster = to_fixed_point(**{**dict(same.items()), "acceleration": 2.0 * same.acceleration})
    for old in (near_ringing, faster):
        assert is_better(verification(old, 0.1), verification(same, 0.1), DESIGN)
        assert not is_better(verification(old, 0.1), verification(same, 0.2), DESIGN)


def test_the_report_recommends_only_better_gains() -> None:
    old = to_fixed_point(**{**dict(DESIGN.gains.items()), "kp": 0.5 * DESIGN.gains.kp})
    change = f"kp {old.kp:.3g} → {DESIGN.gains.kp:.3g}"
    for better, text in (
        (True, change),
        (False, f"none is worth it: the new gains ({change}) are no better"),
    ):
        board = BoardResults(
            before=verification(old, 0.1), after=verification(DESIGN.gains, 0.1), better=better
        )
        assert f"<b>Changes:</b> {text}" in verdict([], DESIGN, board)
