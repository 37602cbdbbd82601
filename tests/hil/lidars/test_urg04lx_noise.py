"""Compare the simulated lidar's noise and error codes with a log of a real URG-04LX (MINES ParisTech)."""

import gzip
import os
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from thumper_hil.lidars.urg_noise import device_bias, measure_mm

DATA = Path(os.environ.get("THUMPER_DATA", Path(__file__).resolve().parents[3].parent / "shared" / "data"))
LOG = DATA / "slam" / "mines-exp1.dat.gz"

Values = NDArray[np.int32]


@pytest.fixture(scope="module")
def real_mm() -> Values:
    """Return ranges and codes of the log, shape (scans, 606), without the beams that its robot hides."""
    if not LOG.exists():
        pytest.skip(f"no recorded log at {LOG}; set THUMPER_DATA to the folder that contains slam/")
    with gzip.open(LOG, "rt") as lines:
        return np.array([[int(word) for word in line.split()[24:706]] for line in lines], np.int32)[:, 53:659]


@pytest.fixture(scope="module")
def simulated_mm(real_mm: Values) -> Values:
    """Simulate the same scans: the log's ranges are the truth, its error codes mean no target."""
    rng = np.random.default_rng(1)
    bias = device_bias(real_mm.shape[1], rng)
    true_m = np.where(real_mm >= 20, 1e-3 * real_mm, np.inf)
    return np.array([measure_mm(scan, bias, rng) for scan in true_m])


def share(values_mm: Values, code: int) -> float:
    return float((values_mm == code).mean())


@pytest.mark.parametrize(("code", "factor"), [(0, 1.12), (7, 1.6), (6, 2.0), (1, 2.0), (2, 3.0), (10, 2.5)])
def test_error_code_rates_match_the_log(
    real_mm: Values, simulated_mm: Values, code: int, factor: float
) -> None:
    assert share(real_mm, code) / factor < share(simulated_mm, code) < share(real_mm, code) * factor


def test_only_error_codes_from_the_log_occur(real_mm: Values, simulated_mm: Values) -> None:
    assert set(Counter(simulated_mm[simulated_mm < 20].tolist())) <= set(real_mm[real_mm < 20].tolist())
    assert simulated_mm.max() <= 5600


def test_loss_rate_grows_with_range_as_in_the_log(real_mm: Values, simulated_mm: Values) -> None:
    """In the stationary log, 1 % of the beams at 1-1.5 m are lost from scan to scan, and 6 % at 3-4 m."""
    lost = simulated_mm < 20
    near, far = (real_mm >= 1000) & (real_mm < 1500), (real_mm >= 3000) & (real_mm < 4000)
    assert 0.003 < lost[near].mean() < 0.03
    assert 0.03 < lost[far].mean() < 0.12


def roughness_mm(values_mm: Values, low_mm: int, high_mm: int) -> float:
    """Return the robust sigma of beam-to-beam noise: fourth differences of five valid beams, unit gain."""
    windows = np.lib.stride_tricks.sliding_window_view(values_mm, 5, axis=1).astype(np.float64)
    valid = (windows >= 20).all(axis=-1) & (windows[..., 2] >= low_mm) & (windows[..., 2] < high_mm)
    fourth = windows[valid] @ np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / np.sqrt(70.0)
    return float(1.4826 * np.median(np.abs(fourth)))


@pytest.mark.parametrize(
    ("low_mm", "high_mm", "log_sigma_mm"), [(500, 1000, 5), (1000, 2000, 4), (2000, 4000, 7)]
)
def test_scan_to_scan_noise_matches_the_stationary_log(
    low_mm: int, high_mm: int, log_sigma_mm: float
) -> None:
    """The sigmas were measured in the log between stationary scans; the simulated wall is flat."""
    rng = np.random.default_rng(2)
    true_m = np.tile(np.linspace(1e-3 * low_mm, 1e-3 * high_mm, 682), (300, 1))
    scans = np.array([measure_mm(scan, np.zeros(682), rng) for scan in true_m]).astype(np.float64)
    scans[scans < 20] = np.nan
    sigma_mm = float(np.median(np.nanstd(scans, axis=0)))
    assert 0.5 * log_sigma_mm < sigma_mm < 1.5 * log_sigma_mm


def test_beam_to_beam_noise_is_at_least_that_of_the_log(real_mm: Values) -> None:
    wall_mm = np.array(
        [measure_mm(np.full(606, 1.5), np.zeros(606), np.random.default_rng(k)) for k in range(50)]
    )
    assert roughness_mm(wall_mm, 1000, 2000) > roughness_mm(real_mm, 1000, 2000)


def test_systematic_error_matches_the_data_sheet() -> None:
    """30 mm up to 1 m and 3 % beyond are three sigma over many devices; the error is smooth."""
    biases = np.array([device_bias(682, np.random.default_rng(seed)) for seed in range(300)])
    assert np.std(biases) == pytest.approx(1.0, abs=0.07)
    assert (np.abs(biases) < 3.0).mean() > 0.995
    assert np.abs(np.diff(biases, axis=1)).max() < 0.1
    rng = np.random.default_rng(5)
    for true_m, sigma_mm in ((0.6, 10.0), (3.0, 30.0)):
        means = [
            float(np.median(measure_mm(np.full(682, true_m), np.full(682, bias), rng)) - 1000 * true_m)
            for bias in (-1.0, 1.0)
        ]
        assert means == pytest.approx([-sigma_mm, sigma_mm], abs=2.0)
