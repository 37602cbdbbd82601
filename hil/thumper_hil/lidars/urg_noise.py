"""Model the measurement errors of a URG-04LX (noise, missing echoes, error codes), fitted to a real log.

The numbers come from two sources. The data sheet gives an accuracy of 30 mm up to 1 m and 3 % beyond; it is
taken as three sigma of an error that is constant per device and smooth over the bearing. The log of a real
URG-04LX (MINES ParisTech, 756 scans, without the beams that its robot hides) gives the scan-to-scan noise
while stationary, and the error codes in runs without an echo, at their ends and at jumps in depth.
docs/results/sensors.md has the table.
"""

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper_hil.effects.echo_loss import random_runs
from thumper_hil.effects.mixed_pixels import jumps_in_depth, mix_at_edges

RANGE_MIN_MM, RANGE_MAX_MM = 20, 5600
NO_RETURN, NEIGHBOUR_ERROR = 0, 7

BIAS_FLOOR_MM, BIAS_SHARE = 10.0, 0.01  # one sigma of the data sheet's 30 mm and 3 %
BIAS_WIDTH_BEAMS = 60.0  # walls in the log bend by at most 3-7 mm over 41 beams: the error is smooth
NOISE_MM, NOISE_MM_PER_M = 2.0, 1.3  # one sigma per beam

SINGLE_LOSS_AT_M = np.array([0.0, 0.7, 1.5, 2.2, 3.5, 4.2, 5.0, 5.6])
SINGLE_LOSS = np.array([0.0001, 0.001, 0.002, 0.005, 0.0065, 0.011, 0.018, 0.018])
SINGLE_LOSS_IS_NEIGHBOUR_ERROR = 0.6  # otherwise no return
RUN_LOSS_AT_M = np.array([0.5, 1.2, 1.8, 2.5, 3.5, 4.5, 5.6])
RUN_LOSS = np.array([0.001, 0.007, 0.014, 0.04, 0.05, 0.08, 0.08])  # share of beams
RUN_LENGTH_BEAMS = 6.0

NO_RETURN_NEIGHBOUR_ERROR = 0.022  # a single 7 inside a run without return
NO_RETURN_END_NEIGHBOUR_ERROR = 0.10  # in the first or last beam of a run
NO_RETURN_CODES = ((6, 0.0036, 4.6), (1, 0.0012, 3.3), (2, 0.0007, 2.4))  # code, starts per beam, mean length

JUMP_CODES = ((7, 0.05), (10, 0.02), (8, 0.012), (15, 0.008))  # code, probability at a jump in depth
JUMP_MIXED = 0.3  # the spot covers both surfaces: the range is between them

CodeArray = NDArray[np.int32]


def device_bias(beams: int, rng: np.random.Generator) -> FloatArray:
    """Return one device's systematic error, shape (beams,), unit variance, smooth over the bearing."""
    reach = int(3 * BIAS_WIDTH_BEAMS)
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (BIAS_WIDTH_BEAMS / np.sqrt(2.0))) ** 2)
    smooth = np.convolve(rng.standard_normal(beams + 2 * reach), bell, mode="valid")
    return np.asarray(smooth / np.sqrt(np.sum(bell**2)), np.float64)


def measure_mm(true_m: FloatArray, bias: FloatArray, rng: np.random.Generator) -> CodeArray:
    """Return the reported values [mm, or an error code below 20] for true ranges [m], both of shape (n,).

    +inf means no target. Every scan of n beams draws the same number of random values.
    """
    beams = true_m.size
    bounded_m = np.where(np.isfinite(true_m), true_m, 1e3)
    mixed_mm = 1000.0 * mix_at_edges(bounded_m, 1e-3 * RANGE_MAX_MM, JUMP_MIXED, rng)
    sigma_bias_mm = np.maximum(BIAS_FLOOR_MM, BIAS_SHARE * mixed_mm)
    sigma_noise_mm = NOISE_MM + NOISE_MM_PER_M * 1e-3 * mixed_mm
    noisy_mm = mixed_mm + bias * sigma_bias_mm + rng.standard_normal(beams) * sigma_noise_mm
    value = np.rint(np.clip(noisy_mm, RANGE_MIN_MM, 10 * RANGE_MAX_MM)).astype(np.int32)
    lost = (value > RANGE_MAX_MM) | random_runs(
        _interp(mixed_mm, RUN_LOSS_AT_M, RUN_LOSS), RUN_LENGTH_BEAMS, rng
    )
    value[lost] = NO_RETURN
    _put_codes_in_no_return(value, lost, rng)
    _put_codes_at_jumps(value, bounded_m, lost, rng)
    single = rng.random(beams) < _interp(mixed_mm, SINGLE_LOSS_AT_M, SINGLE_LOSS)
    code = np.where(rng.random(beams) < SINGLE_LOSS_IS_NEIGHBOUR_ERROR, NEIGHBOUR_ERROR, NO_RETURN)
    return np.where(single & ~lost, code, value).astype(np.int32)


def _interp(range_mm: FloatArray, at_m: FloatArray, share: FloatArray) -> FloatArray:
    return np.interp(1e-3 * range_mm, at_m, share)


def _put_codes_in_no_return(value: CodeArray, lost: NDArray[np.bool_], rng: np.random.Generator) -> None:
    for code, start, length_beams in NO_RETURN_CODES:
        run = random_runs(np.full(value.size, start * length_beams), length_beams, rng)
        value[run & lost] = code
    inside = np.convolve(lost, np.ones(3), mode="same") > 2.5
    probability = np.where(inside, NO_RETURN_NEIGHBOUR_ERROR, NO_RETURN_END_NEIGHBOUR_ERROR)
    value[lost & (rng.random(value.size) < probability)] = NEIGHBOUR_ERROR


def _put_codes_at_jumps(
    value: CodeArray, true_m: FloatArray, lost: NDArray[np.bool_], rng: np.random.Generator
) -> None:
    draw = rng.random(value.size)
    at_jump = jumps_in_depth(true_m) & ~lost
    low = 0.0
    for code, probability in JUMP_CODES:
        value[at_jump & (draw >= low) & (draw < low + probability)] = code
        low += probability
