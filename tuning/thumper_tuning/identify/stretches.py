"""The validation fit of each kind of stretch: ramps are easy, and hide how well steps are predicted."""

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.cross_validation import Validation
from thumper_tuning.identify.fit import Fit
from thumper_tuning.identify.least_squares import are_shown
from thumper_tuning.identify.segments import LogSegment, all_speeds

JUMP = 0.08  # of the largest drive: a smaller change between windows is a part of a ramp
STEP_HOLD_S = 0.5  # a level that holds this long, or three time constants, is a step
# Random switching: levels of up to two such times in a row, at least so many without those at zero. Half of
# them are shorter than a step, and their lengths differ by this factor: a square wave is of steps.
MIN_SWITCHES, SWITCH_RATIO = 4, 1.5
MIN_WINDOWS = 10


def fit_by_kind(segments: list[LogSegment], fit: Fit, validation: Validation) -> dict[str, float]:
    """Return the fit in percent of ramps, steps and random switching, worst first."""
    kinds = np.concatenate([_kinds(s, fit.model.time_constant_s) for s in segments])
    speeds, use = all_speeds(segments), ~fit.is_glitch & are_shown(segments)
    segment = np.repeat(np.arange(len(segments)), [len(s.speed_rad_s) for s in segments])
    found = {}
    for kind in ("ramps", "steps", "random"):
        rows = use & (kinds == kind)
        if rows.sum() >= MIN_WINDOWS:
            # About the mean of each segment: else opposite directions make the motion large.
            parts = [speeds[rows & (segment == k)] for k in np.unique(segment[rows])]
            motion = np.sqrt(sum(float(np.sum((part - part.mean()) ** 2)) for part in parts))
            if motion <= fit.scale_rad_s * np.sqrt(rows.sum()):
                continue  # moves no more than noise and rounding: nothing to predict
            error = float(np.linalg.norm(validation.residual_rad_s[rows]))
            found[kind] = 100.0 * (1.0 - float(error / motion))
    return dict(sorted(found.items(), key=lambda item: item[1]))


def _kinds(s: LogSegment, time_constant_s: float) -> "np.ndarray[tuple[int], np.dtype[np.str_]]":
    """Return the kind of each window, by the level of the drive that it belongs to."""
    drive = s.drive_at_windows()
    largest = float(np.abs(s.drive).max()) or 1.0
    starts = np.flatnonzero(np.concatenate(([True], np.abs(np.diff(drive)) > JUMP * largest)))
    lasts = np.append(starts[1:], len(drive))
    is_ramp = [np.ptp(drive[a:b]) > 2.0 * JUMP * largest for a, b in zip(starts, lasts, strict=True)]
    holds_s = s.edge_s[lasts] - s.edge_s[starts]
    step_s = max(STEP_HOLD_S, 3.0 * time_constant_s)
    kinds = np.empty(len(drive), dtype="<U6")
    brief = holds_s < 2.0 * step_s
    for run in np.split(np.arange(len(starts)), np.flatnonzero(np.diff(brief)) + 1):
        driven = np.abs(drive[starts[run]]) > JUMP * largest
        driven[run == len(starts) - 1] = False  # cut off by the end of the segment: its length says nothing
        random = brief[run[0]] and _is_random(holds_s[run[driven]], step_s)
        for level in run:
            kind = "ramps" if is_ramp[level] else "random" if random else "steps"
            kinds[starts[level] : lasts[level]] = kind
    return kinds


def _is_random(holds_s: FloatArray, step_s: float) -> bool:
    if len(holds_s) < MIN_SWITCHES or holds_s.max() <= SWITCH_RATIO * holds_s.min():
        return False
    return bool(np.mean(holds_s < step_s) >= 0.5)
