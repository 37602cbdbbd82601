"""The collision monitor: the last check before the wheels. Would this command touch anything?

It checks the points of scan and memory, not the map, so that no error of mapping or planning can cause a
collision.
"""

import math
from dataclasses import dataclass
from itertools import product
from typing import Annotated

import numpy as np
from annotated_types import Ge, Interval

from thumper.common.geometry import FloatArray, Twist2
from thumper.common.numba_kernel import kernel
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits, WheelRamp

STEP_S = 0.05  # of the simulated motion
# A point inside the margin may come nearer by this much in one motion (scan noise between two steps), but
# only through a fraction of the least margin. Each cycle starts again, so any slack without that limit would
# add up to a contact.
DEEPER_M = 0.003
CREEP_FRACTION = 0.25
ROUNDING_M = 1e-9
UNSEEN = "ground that the lidar has never seen"
NOISE_M_S, NOISE_RAD_S = 0.03, 0.06  # a slower measured twist may be noise
# The centre of rotation of a skid-steered base is not fixed (Mandow 2007): it moves along the base by up to
# this, so a turn shifts the base sideways. It hardly moves while a turn reverses, so the net angle counts.
CENTRE_WANDER_M = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class CollisionMonitorOptions:
    """How the collision monitor stops and slows the robot."""

    # Margin kept round the footprint [m].
    margin_m: Annotated[float, Ge(0)] = 0.02
    # Slow zone: a contact sooner than this at the present command slows the robot proportionally [s]; 0 turns
    # it off.
    slow_s: Annotated[float, Ge(0)] = 1.0
    # Least fraction of the speed that the slow zone leaves.
    slow_part: Annotated[float, Interval(gt=0, le=1)] = 0.4


def with_cure(stop_reason: str, cure: str) -> str:
    """Return the reason of a stop and, if the robot stopped before unseen ground, what to do about it."""
    return f"{stop_reason}; {cure}" if cure and UNSEEN in stop_reason else stop_reason


@kernel
def deepening_point(
    points_m: FloatArray,
    margins_m: FloatArray,
    creep_m: float,
    half_planes: FloatArray,
    poses: FloatArray,
    shifts_m: FloatArray,
) -> int:
    """Return the index of the first point, shape (n, 2), that a motion brings inside the footprint, or -1.

    The footprint is grown by the point's margin, shape (n,). `poses`, shape (m, 3), are base poses in the
    frame of the points; the base starts at the origin. At each of them it may be further to either side by
    `shifts_m`, shape (m,). A point that is inside at the start counts only if it gets deeper, with a small
    slack up to the depth `creep_m`.
    """
    for i in range(points_m.shape[0]):
        px, py = points_m[i]
        margin_m = margins_m[i]
        allowed = 0.0
        for j in range(-1, poses.shape[0]):
            x, y, theta, shift_m = 0.0, 0.0, 0.0, 0.0
            if j >= 0:
                x, y, theta, shift_m = poses[j, 0], poses[j, 1], poses[j, 2], shifts_m[j]
            cos, sin = math.cos(theta), math.sin(theta)
            dx, dy = px - x, py - y
            bx, by = cos * dx + sin * dy, -sin * dx + cos * dy
            depth = np.inf
            for k in range(half_planes.shape[0]):
                inside = half_planes[k, 2] + margin_m - half_planes[k, 0] * bx - half_planes[k, 1] * by
                inside += shift_m * abs(half_planes[k, 1])
                depth = min(depth, inside)
            if j < 0:
                slack = min(DEEPER_M, max(ROUNDING_M, creep_m - depth))
                allowed = max(0.0, depth + slack)
            elif depth > allowed:
                return i
    return -1


@kernel
def steps_to_contact(points_m: FloatArray, half_planes: FloatArray, poses: FloatArray) -> int:
    """Count the poses, shape (m, 3), before a point, shape (n, 2), is inside the footprint; m if never."""
    for j in range(poses.shape[0]):
        cos, sin = math.cos(poses[j, 2]), math.sin(poses[j, 2])
        for i in range(points_m.shape[0]):
            dx, dy = points_m[i, 0] - poses[j, 0], points_m[i, 1] - poses[j, 1]
            bx, by = cos * dx + sin * dy, -sin * dx + cos * dy
            depth = np.inf
            for k in range(half_planes.shape[0]):
                depth = min(depth, half_planes[k, 2] - half_planes[k, 0] * bx - half_planes[k, 1] * by)
            if depth > 0.0:
                return j
    return int(poses.shape[0])


class CollisionMonitor:
    """Passes a command, slows it down, or reports what it would touch."""

    def __init__(
        self,
        options: CollisionMonitorOptions,
        limits: SpeedLimits,
        footprint: Footprint,
        ramp: WheelRamp | None = None,
    ) -> None:
        self._options = options
        self._limits = limits
        self._ramp = ramp or WheelRamp.from_drive(limits)
        self._half_planes = footprint.half_planes()
        self._radius_m = footprint.circumscribed_radius_m

    def stop_reason(
        self,
        command: Twist2,
        twist: Twist2,
        hits_in_base_m: FloatArray,
        position_error_m: FloatArray,
        period_s: float,
        *,
        seen: int | None = None,
    ) -> str | None:
        """Return what the command would touch, or None.

        Parameters
        ----------
        command, twist : Twist2
            The next command, and the measured twist.
        hits_in_base_m : ndarray, shape (n, 2)
            Obstacle points [m], and after them unseen ground.
        position_error_m : ndarray, shape (n,)
            Added to the margin of each point.
        period_s : float
            Time that the command is active.
        seen : int, optional
            How many of the points are obstacles; None: all.

        Notes
        -----
        The motion is: the measured twist during the latency, the command for one period, then the zero
        command. v and w fade as the wheels' ramps or as the limits say, whichever takes longer. It is checked
        again with a turn that ends at once: a base that straightens sooner than predicted leaves the bend. If
        the measured twist is within its noise, it is also checked from standstill: noise that points away
        from an obstacle must not excuse a command toward it. The centre of rotation may be off by
        `CENTRE_WANDER_M`.
        """
        margins_m = self._options.margin_m + position_error_m
        creep_m = CREEP_FRACTION * self._options.margin_m
        is_noise = abs(twist.v_m_s) < NOISE_M_S and abs(twist.w_rad_s) < NOISE_RAD_S
        keeps_turning = (True, False) if command.w_rad_s else (True,)
        for start, turns_on in product((twist, Twist2()) if is_noise else (twist,), keeps_turning):
            poses = self._stopping_poses(command, start, period_s, turns_on=turns_on)
            shifts_m = CENTRE_WANDER_M * np.abs(poses[:, 2])
            furthest_m = float((np.hypot(*poses[:, :2].T) + shifts_m).max())
            reach_m = self._radius_m + margins_m.max(initial=0.0) + furthest_m
            near = np.hypot(hits_in_base_m[:, 0], hits_in_base_m[:, 1]) <= reach_m
            points_m = np.ascontiguousarray(hits_in_base_m[near])
            index = deepening_point(points_m, margins_m[near], creep_m, self._half_planes, poses, shifts_m)
            if index >= 0:
                x_m, y_m = points_m[index]
                what = "an obstacle"
                if seen is not None and np.flatnonzero(near)[index] >= seen:
                    what = UNSEEN
                along, across = "ahead of" if x_m >= 0.0 else "behind", "left" if y_m >= 0.0 else "right"
                return (
                    f"stopped before {what} {abs(x_m):.2f} m {along} the robot's centre, "
                    f"{abs(y_m):.2f} m to its {across}"
                )
        return None

    def slow_down(self, command: Twist2, hits_in_base_m: FloatArray) -> Twist2:
        """Return the command, slowed proportionally if it would touch something within `slow_s`.

        Both speeds shrink alike, so the robot stays on its arc.
        """
        slow_s = self._options.slow_s
        reach_m = self._radius_m + abs(command.v_m_s) * slow_s
        near = np.hypot(hits_in_base_m[:, 0], hits_in_base_m[:, 1]) <= reach_m
        points_m = np.ascontiguousarray(hits_in_base_m[near])
        if slow_s == 0.0 or points_m.shape[0] == 0 or command.v_m_s == 0.0:
            return command
        times_s = np.arange(STEP_S, slow_s, STEP_S)
        headings_rad = command.w_rad_s * times_s
        means_rad = headings_rad - 0.5 * command.w_rad_s * STEP_S
        x_m, y_m = (np.cumsum(command.v_m_s * STEP_S * f(means_rad)) for f in (np.cos, np.sin))
        free = steps_to_contact(points_m, self._half_planes, np.column_stack((x_m, y_m, headings_rad)))
        if free == times_s.size:
            return command
        fraction = max(self._options.slow_part, free * STEP_S / slow_s)
        return Twist2(v_m_s=fraction * command.v_m_s, w_rad_s=fraction * command.w_rad_s)

    def _stopping_poses(
        self, command: Twist2, twist: Twist2, period_s: float, *, turns_on: bool
    ) -> FloatArray:
        """Return the poses until the robot has stopped, shape (n, 3)."""
        limits = self._limits
        driven_s = limits.latency_s + period_s
        braking_s = max(
            abs(command.v_m_s) / limits.v_accel_m_s2,
            abs(command.w_rad_s) / limits.w_accel_rad_s2,
            self._ramp.braking_s(command),
        )
        times_s = np.arange(0.0, driven_s + braking_s, STEP_S) + 0.5 * STEP_S
        fading_s = np.maximum(0.0, times_s - driven_s)
        v_ramp, w_ramp = self._ramp.braked(command, fading_s)
        responds = times_s > limits.latency_s
        v = np.where(responds, _faded(command.v_m_s, limits.v_accel_m_s2, fading_s, v_ramp), twist.v_m_s)
        w = np.where(
            responds, _faded(command.w_rad_s, limits.w_accel_rad_s2, fading_s, w_ramp), twist.w_rad_s
        )
        if not turns_on:
            w = np.where(fading_s > 0.0, 0.0, w)
        headings_rad = np.cumsum(w) * STEP_S
        means_rad = headings_rad - 0.5 * w * STEP_S
        x_m, y_m = np.cumsum(v * np.cos(means_rad)) * STEP_S, np.cumsum(v * np.sin(means_rad)) * STEP_S
        return np.column_stack((x_m, y_m, headings_rad))


def _faded(speed: float, accel: float, times_s: FloatArray, ramp: FloatArray) -> FloatArray:
    """Return the rest of a speed that fades at `accel` or as `ramp`, shape (n,), whichever is more."""
    fading = np.maximum(0.0, abs(speed) - accel * times_s)
    return math.copysign(1.0, speed) * np.maximum(fading, math.copysign(1.0, speed) * ramp)
