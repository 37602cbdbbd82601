"""Guess the unit of a time column whose header names none, by the period that results."""

import math

import numpy as np

from thumper.common.geometry import FloatArray

USUAL_PERIOD_S = 0.03
MIN_PERIOD_S, MAX_PERIOD_S = 2e-4, 2.0
UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def guess_time_unit(values: FloatArray) -> tuple[str, float]:
    """Return the unit whose median period is nearest to 30 ms on a logarithmic scale, and its seconds.

    Seconds stay seconds if the period is 0.2 ms ... 1 s: a column of seconds needs no guess.
    """
    steps = np.diff(values)
    steps = steps[np.isfinite(steps) & (steps > 0.0)]
    if not steps.size:
        return "s", 1.0
    period = float(np.median(steps))
    if MIN_PERIOD_S <= period < 1.0:
        return "s", 1.0
    plausible = {
        name: scale for name, scale in UNITS.items() if MIN_PERIOD_S <= period * scale <= MAX_PERIOD_S
    }
    if not plausible:
        return "s", 1.0
    name = min(plausible, key=lambda unit: abs(math.log(period * plausible[unit] / USUAL_PERIOD_S)))
    return name, plausible[name]
