"""Buffer of the last seconds of odometry, to look up the pose at the start of a scan."""

import math
from bisect import bisect_right
from collections import deque

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.odometry.wheel_odometry import OdometrySample, advance


def interpolate(start: Pose2, end: Pose2, fraction: float) -> Pose2:
    """Return the pose at `fraction` of the motion, at a constant twist (screw motion in SE(2)).

    Exact for a robot on an arc. `fraction` may lie outside 0...1.
    """
    delta = start.inverse() @ end
    turn_rad = delta.theta_rad
    # The chord leaves the start at half the rotation from the tangent; the fraction scales both.
    half_rad, part_rad = 0.5 * turn_rad, 0.5 * fraction * turn_rad
    scale = math.sin(part_rad) / math.sin(half_rad) if half_rad else fraction
    bearing_rad = math.atan2(delta.y_m, delta.x_m) - half_rad + part_rad
    chord_m = scale * math.hypot(delta.x_m, delta.y_m)
    step = Pose2(
        x_m=chord_m * math.cos(bearing_rad),
        y_m=chord_m * math.sin(bearing_rad),
        theta_rad=fraction * turn_rad,
    )
    return start @ step


def interpolate_poses(times_s: FloatArray, known_s: FloatArray, known: FloatArray) -> FloatArray:
    """Return the pose at each of `times_s`, shape (n, 3), linear in x, y and unwrapped heading.

    `known` holds x, y, theta [m, m, rad] at the rising times `known_s`, shapes (k, 3) and (k,). Before the
    first and after the last of them the robot is assumed to be stationary. For samples as close as 0.1 s;
    over longer arcs use `interpolate`.
    """
    headings_rad = np.unwrap(known[:, 2])
    columns = [np.interp(times_s, known_s, column) for column in (known[:, 0], known[:, 1], headings_rad)]
    return np.column_stack(columns)


class PoseBuffer:
    """Odometry samples of the last seconds; interpolates between them and extrapolates a little."""

    def __init__(self, horizon_s: float = 3.0, extrapolation_s: float = 0.25) -> None:
        """Keep `horizon_s` of samples; extrapolate the last twist for at most `extrapolation_s`."""
        self._horizon_s = horizon_s
        self._extrapolation_s = extrapolation_s
        self._samples: deque[OdometrySample] = deque()

    def add(self, sample: OdometrySample) -> None:
        """Append a sample. Drops one older than the newest; one older than all is a clock set back."""
        if self._samples and sample.time_s < self._samples[0].time_s:
            self._samples.clear()
        if self._samples and sample.time_s <= self._samples[-1].time_s:
            return
        self._samples.append(sample)
        while sample.time_s - self._samples[0].time_s > self._horizon_s:
            self._samples.popleft()

    def covers(self, time_s: float) -> bool:
        """Return whether `at(time_s)` is interpolated or extrapolated, and not clamped."""
        return bool(self._samples) and (
            self._samples[0].time_s <= time_s <= self._samples[-1].time_s + self._extrapolation_s
        )

    def at(self, time_s: float) -> Pose2:
        """Return `odom_from_base` at `time_s`, clamped to the oldest sample and the extrapolation limit.

        Raises
        ------
        ValueError
            The buffer is empty.
        """
        if not self._samples:
            raise ValueError("the pose buffer is empty")
        newest = self._samples[-1]
        if time_s >= newest.time_s:
            ahead_s = min(time_s - newest.time_s, self._extrapolation_s)
            return advance(
                newest.odom_from_base, newest.twist.v_m_s * ahead_s, newest.twist.w_rad_s * ahead_s
            )
        index = bisect_right(self._samples, time_s, key=lambda sample: sample.time_s)
        if index == 0:
            return self._samples[0].odom_from_base
        before, after = self._samples[index - 1], self._samples[index]
        fraction = (time_s - before.time_s) / (after.time_s - before.time_s)
        return interpolate(before.odom_from_base, after.odom_from_base, fraction)
