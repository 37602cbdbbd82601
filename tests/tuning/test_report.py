"""The report's words about the effect of new gains."""

import numpy as np
import pytest

from thumper_tuning.drive.verify import COLUMNS, TrackingError, tracking_error
from thumper_tuning.report.text import tracking_change


def drive(std_rad_s: float, seed: int) -> TrackingError:
    """Return the tracking error of 130 ticks with a random error."""
    rows = np.zeros((130, len(COLUMNS)))
    rows[:, 2] = 1.0
    rows[:, [4, 7]] = np.random.default_rng(seed).normal(0.0, std_rad_s, (130, 2))
    return tracking_error(rows, 4.0)


def test_the_standard_error_is_the_spread_between_drives() -> None:
    found = [drive(0.1, seed) for seed in range(100)]
    spread = float(np.std([t.std_rad_s for t in found]))
    assert float(np.mean([t.std_error_rad_s for t in found])) == pytest.approx(spread, rel=0.25)


def test_noise_is_not_reported_as_an_effect() -> None:
    quiet = [tracking_change(drive(0.1, k), drive(0.1, k + 100)) for k in range(20)]
    assert sum("no change beyond the noise" in text for text in quiet) >= 17
    assert "noise" not in tracking_change(drive(0.1, 1), drive(0.2, 2))
