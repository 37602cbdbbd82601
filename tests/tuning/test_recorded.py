"""Motors recorded by others; the data may not be redistributed."""

import os
from pathlib import Path

import numpy as np
import pytest

from thumper.common.errors import ThumperError
from thumper_tuning.identify.cross_validation import fit_percent
from thumper_tuning.identify.motor import identify
from thumper_tuning.logs.read import read_logs

DATA = Path(os.environ.get("THUMPER_DATA", Path(__file__).parents[2].parent / "shared" / "data")) / "motor"
STEPS = sorted(DATA.glob("geared-steps-odd/*.csv"))
DRIVETRAIN = DATA / "drivetrain-sysid" / "sysid_data.json"

pytestmark = pytest.mark.skipif(not STEPS, reason=f"no recorded motors in {DATA}; set THUMPER_DATA")


def test_steps_of_a_geared_motor_are_predicted() -> None:
    """Held-out tenths of five open-loop steps; the driver's nonlinear map gives a negative friction."""
    logs = [read_logs(path, counts_per_rev=1320.0)[0] for path in STEPS]
    motor = identify(logs, one_direction=True)
    assert motor.validation.fit_percent >= 93.0
    assert motor.model.friction < 0.0
    assert any("negative" in warning for warning in motor.warnings)
    assert motor.model.time_constant_s == pytest.approx(0.091, abs=0.01)


def test_one_step_alone_is_rejected() -> None:
    with pytest.raises(ThumperError, match="no excitation"):
        identify(read_logs(STEPS[0], counts_per_rev=1320.0))


@pytest.mark.parametrize(("side", "regression_percent"), [(0, (92.0, 68.0)), (1, (92.0, 63.0))])
def test_a_drive_train_is_predicted_better_than_by_regression(
    side: int, regression_percent: tuple[float, float]
) -> None:
    """Fit of simulated speeds, on ramps and steps, against the published regression's figures."""
    motor = identify([read_logs(DRIVETRAIN)[side]])
    first = 0
    for segment, bar in zip(motor.segments, np.repeat(regression_percent, 2), strict=True):
        last = first + len(segment.speed_rad_s)
        residual = motor.fit.residual_rad_s[first:last]
        assert fit_percent(segment.speed_rad_s, residual) > bar
        first = last
