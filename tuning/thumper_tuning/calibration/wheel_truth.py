"""True wheel speeds as the thesis defines them, equations 8.1 to 8.5, with their signs corrected. Pure.

The thesis prints x_L = x + l/2 cos(theta), y_L = y + l/2 sin(theta). That point is ahead of the robot, not at
its left wheel. And (8.5) is a length, which cannot distinguish backward from forward. Here
x_L = x - l/2 sin(theta), y_L = y + l/2 cos(theta), with opposite signs for the right wheel, and distance is
signed along the heading.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Gt
from scipy.signal import butter, filtfilt

from thumper.common.geometry import FloatArray
from thumper_tuning.calibration.wheel_log import WheelLog

MIN_POSES_TO_FILTER = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelGeometry:
    """Converts counts and poses to wheel speeds. There are two radii, because no two tyres are equal."""

    left_radius_m: Annotated[float, Gt(0)]
    right_radius_m: Annotated[float, Gt(0)]
    track_m: Annotated[float, Gt(0)]
    counts_per_rev: Annotated[float, Gt(0)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WheelComparison:
    """Speeds per tick [rad/s], shape (n, 2): left and right, from the encoders and from the reference."""

    time_s: FloatArray
    encoder_rad_s: FloatArray
    reference_rad_s: FloatArray

    @property
    def error_rad_s(self) -> FloatArray:
        """Encoder minus reference, as in the thesis, shape (n, 2)."""
        return self.encoder_rad_s - self.reference_rad_s


def compare_wheel_speeds(log: WheelLog, geometry: WheelGeometry, cutoff_Hz: float = 5.0) -> WheelComparison:
    """Compare encoder and reference over the ticks.

    The reference is low-pass filtered without lag (second-order Butterworth, forward and backward), unless
    its rate is below 4 cutoff frequencies. Then it is averaged over the tick, as counts are.
    """
    travel = np.column_stack([_travel(log.poses, side * geometry.track_m) for side in (0.5, -0.5)])
    travel /= (geometry.left_radius_m, geometry.right_radius_m)
    known_s = log.poses[:, 0]
    step_s = float(np.median(np.diff(known_s)))
    if 1.0 / step_s > 4.0 * cutoff_Hz and len(known_s) > MIN_POSES_TO_FILTER:
        # The filter preserves straight lines, so it can filter the distance: no drift builds up.
        b, a = butter(2, cutoff_Hz, fs=1.0 / step_s)
        travel = filtfilt(b, a, travel, axis=0)
    at_ticks = np.column_stack([np.interp(log.time_s, known_s, side) for side in travel.T])
    counts = np.column_stack((log.left_counts, log.right_counts)) * 2.0 * np.pi / geometry.counts_per_rev
    dt_s = np.diff(log.time_s)[:, None]
    return WheelComparison(
        time_s=0.5 * (log.time_s[1:] + log.time_s[:-1]),
        encoder_rad_s=np.diff(counts, axis=0) / dt_s,
        reference_rad_s=np.diff(at_ticks, axis=0) / dt_s,
    )


def _travel(poses: FloatArray, offset_m: float) -> FloatArray:
    """Return the signed distance of a wheel `offset_m` to the left of the center [m], shape (n,)."""
    heading = np.unwrap(poses[:, 3])
    x_m = poses[:, 1] - offset_m * np.sin(heading)
    y_m = poses[:, 2] + offset_m * np.cos(heading)
    middle = 0.5 * (heading[1:] + heading[:-1])
    half = 0.5 * np.diff(heading)
    along = np.diff(x_m) * np.cos(middle) + np.diff(y_m) * np.sin(middle)
    chord = np.sinc(half / np.pi)  # the arc is longer than its chord
    return np.concatenate(([0.0], np.cumsum(along / chord)))
