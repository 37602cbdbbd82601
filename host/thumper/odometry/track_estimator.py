"""The effective track of a skid-steered base, from the turns of its wheels and of a gyroscope."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

SEGMENT_RAD = 0.5  # turn of the wheels in one comparison: a curve, not one step of it
MIN_SEGMENTS, MAX_SEGMENTS = 3, 100
RELATIVE_STD = 0.03  # offer a track that is known this well ...
RELATIVE_CHANGE = 0.08  # ... and differs this much from the configured one


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnRatio:
    """The true turn divided by that of the wheels, which is the configured track by the effective one."""

    ratio: float
    spread: float  # relative std from segment to segment
    segments: int

    @property
    def relative_std(self) -> float:
        """Standard deviation of the ratio, by the ratio; that of a median."""
        return 1.2533 * self.spread / math.sqrt(self.segments)

    @property
    def noise_rad(self) -> float:
        """Standard deviation of the turn of the wheels after 1 rad [rad]."""
        return self.spread * math.sqrt(self.ratio * SEGMENT_RAD)


class TrackEstimator:
    """Compares turns of 0.5 rad. The median of their ratios ignores those in which the wheels slipped."""

    def __init__(self, track_m: float) -> None:
        """`track_m` is the track with which the turns of the wheels were computed."""
        self._track_m = track_m
        self._gyro_rad = self._wheels_rad = 0.0
        self._ratios: deque[float] = deque(maxlen=MAX_SEGMENTS)
        self.ratio: TurnRatio | None = None  # None before enough turns

    def add(self, gyro_rad: float, wheels_rad: float) -> None:
        """Add the turn of a step by both."""
        if wheels_rad * self._wheels_rad < 0.0:  # the direction changed
            self._gyro_rad = self._wheels_rad = 0.0
        self._gyro_rad += gyro_rad
        self._wheels_rad += wheels_rad
        if abs(self._wheels_rad) >= SEGMENT_RAD:
            ratio = self._gyro_rad / self._wheels_rad
            self._gyro_rad = self._wheels_rad = 0.0
            if ratio > 0.0:
                self._ratios.append(ratio)
                self.ratio = self._estimate()

    def offer(self) -> str:
        """Return one line if the track is known well and is not the configured one, else an empty text."""
        found = self.ratio
        if found is None or found.relative_std > RELATIVE_STD or abs(found.ratio - 1.0) < RELATIVE_CHANGE:
            return ""
        track_m = self._track_m / found.ratio
        return (
            f"by the gyroscope the effective track is {track_m:.3f} +- {found.relative_std * track_m:.3f} m, "
            f"[drive] track_m says {self._track_m:g}: set it to {track_m:.3f}"
        )

    def _estimate(self) -> TurnRatio | None:
        if len(self._ratios) < MIN_SEGMENTS:
            return None
        ratios = np.array(self._ratios)
        median = float(np.median(ratios))
        spread = 1.4826 * float(np.median(np.abs(ratios - median))) / median
        return TurnRatio(ratio=median, spread=spread, segments=ratios.size)
