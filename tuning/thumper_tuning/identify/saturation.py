"""Find speeds that the logger clipped: they stay at their maximum while the drive still changes."""

from dataclasses import replace

import numpy as np

from thumper_tuning.identify.segments import LogSegment, all_speeds

MIN_SHARE = 0.08  # of the windows are at the maximum
MAX_QUANTUM_SHARE = 0.03  # of it: coarser speeds repeat without being clipped
DRIVE_RATIO = 1.08  # of the drives at the maximum, 95th over 20th percentile


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
    if max(s.quantum_rad_s for s in segments) > MAX_QUANTUM_SHARE * top:
        return np.inf
    drive = np.abs(np.concatenate([s.drive_at_windows() for s in segments]))[at_top]
    return top if np.percentile(drive, 95) > DRIVE_RATIO * np.percentile(drive, 20) else np.inf
