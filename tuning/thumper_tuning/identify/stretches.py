"""The validation fit of each kind of stretch: ramps are easy, and hide how well steps are predicted."""

import numpy as np

from thumper_tuning.identify.cross_validation import Validation
from thumper_tuning.identify.fit import Fit
from thumper_tuning.identify.least_squares import are_shown
from thumper_tuning.identify.segments import LogSegment, all_speeds

JUMP = 0.08  # of the largest drive: a smaller change between windows is a part of a ramp
STEP_HOLD_S = 0.5  # a level that holds this long, or six time constants, is a step
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
            error = float(np.linalg.norm(validation.residual_rad_s[rows]))
            found[kind] = 100.0 * (1.0 - error / motion) if motion > 0.0 else 0.0
    return dict(sorted(found.items(), key=lambda item: item[1]))


def _kinds(s: LogSegment, time_constant_s: float) -> "np.ndarray[tuple[int], np.dtype[np.str_]]":
    """Return the kind of each window, by the level of the drive that it belongs to."""
    drive = s.drive_at_windows()
    largest = float(np.abs(s.drive).max()) or 1.0
    starts = np.flatnonzero(np.concatenate(([True], np.abs(np.diff(drive)) > JUMP * largest)))
    hold_s = max(STEP_HOLD_S, 6.0 * time_constant_s)
    kinds = np.empty(len(drive), dtype="<U6")
    for first, last in zip(starts, [*starts[1:], len(drive)], strict=True):
        level = drive[first:last]
        if np.ptp(level) > 2.0 * JUMP * largest:
            kinds[first:last] = "ramps"
        else:
            long = s.edge_s[last] - s.edge_s[first] >= hold_s
            kinds[first:last] = "steps" if long else "random"
    return kinds
