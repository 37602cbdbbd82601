"""Find speeds that the logger clipped: they stay at their maximum while the drive still changes."""

from dataclasses import replace

import numpy as np

from thumper_tuning.identify.segments import LogSegment, all_speeds

MIN_SHARE = 0.08  # of the windows are at the maximum
DRIVE_SPREAD = 0.08  # of the drives at the maximum, from 20th to 95th percentile
SPREAD_QUANTA = 2.0  # of the maximum: a smaller spread may hide in coarse speeds that are not clipped


def with_ceiling(segments: list[LogSegment]) -> list[LogSegment]:
    """Return the segments with the speed at which each is clipped; each may have its own range."""
    whole = _ceiling_rad_s(segments)
    return [replace(s, ceiling_rad_s=min(whole, _ceiling_rad_s([s]))) for s in segments]


def _ceiling_rad_s(segments: list[LogSegment]) -> float:
    speed = np.abs(all_speeds(segments)) if segments else np.zeros(0)
    top = float(speed.max(initial=0.0))
    at_top = speed >= top * (1.0 - 1e-9)
    if not speed.any() or at_top.mean() < MIN_SHARE:
        return np.inf
    quantum = max(s.quantum_rad_s for s in segments) / top
    drive = np.abs(np.concatenate([s.drive_at_windows() for s in segments]))[at_top]
    low, high = np.percentile(drive, (20, 95))
    return top if high > (1.0 + max(DRIVE_SPREAD, SPREAD_QUANTA * quantum)) * low else np.inf
