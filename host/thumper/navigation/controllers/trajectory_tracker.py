"""The trajectory tracker: a state controller follows a reference that runs along the path.

The cascade of the thesis this robot comes from: trajectory, pose error, state controller, wheel speeds.
Kanayama et al., "A stable tracking control method for an autonomous mobile robot" (1990), control rule:
v = v_r cos(e_theta) + k_x e_x, w = w_r + v_r (k_y e_y + k_theta sin(e_theta)). The errors are those of the
pose that the robot will have when the command takes effect.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.navigation.controllers.controller import Controller, ControlRequest, ControlResult
from thumper.navigation.controllers.rotate_in_place import RotateInPlaceOptions, RotationShim
from thumper.navigation.controllers.stopping_check import AdmissibilityCheck
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.polyline import ahead, arc_lengths, project_onto
from thumper.navigation.speed_limits import SpeedLimits, step_toward

SPEED_FRACTIONS = (1.0, 0.7, 0.45, 0.25)  # tried until the motion is free
ALONG_GAIN = 1.0  # k_x [1/s]
DAMPING = 1.0  # k_theta = 2 damping sqrt(k_y)
TURN_FRACTION = 0.7  # of the highest turn rate is planned in bends; the rest is left to the controller
HALF_CHORD_M = 0.10  # heading and curvature of the path are taken over twice this length
MAX_LEAD_M = 0.10  # the reference waits for a robot that falls back further
LEAST_CURVATURE = 1e-6  # [1/m]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrajectoryTrackerOptions:
    """The state controller's gain, and where the tracker replaces the controller."""

    # Gain of the error across the path [1/m^2]; the robot corrects it within 1/sqrt(gain) metres.
    side_gain: Annotated[float, Gt(0)] = 15.0
    # Distance ahead that must be free for the tracker to replace the controller [m].
    free_ahead_m: Annotated[float, Gt(0)] = 1.0
    # Room beyond the robot's circumscribed circle along this distance [m].
    free_room_m: Annotated[float, Ge(0)] = 0.08


class ReferenceTrajectory:
    """A path as a trajectory: position, curvature and speed at a distance along it from the robot."""

    def __init__(self, path_m: FloatArray, base: Pose2) -> None:
        segment, passed_m = project_onto(path_m, base.x_m, base.y_m)
        self._path_m = path_m[segment:]
        self._along_m = arc_lengths(self._path_m) - passed_m
        self.length_m = float(self._along_m[-1])

    def point(self, distance_m: float) -> FloatArray:
        """Return the position at a distance along the path, shape (2,) [m]."""
        return np.array([np.interp(distance_m, self._along_m, self._path_m[:, axis]) for axis in (0, 1)])

    def heading_rad(self, distance_m: float) -> float:
        """Return the direction of the path there."""
        first_m = float(self._along_m[0])
        low_m = min(max(first_m, distance_m - HALF_CHORD_M), max(first_m, self.length_m - HALF_CHORD_M))
        dx_m, dy_m = self.point(max(distance_m, low_m) + HALF_CHORD_M) - self.point(low_m)
        return math.atan2(dy_m, dx_m)

    def curvature(self, distance_m: float) -> float:
        """Return the curvature there, positive to the left [1/m]."""
        low_m, high_m = max(0.0, distance_m - HALF_CHORD_M), min(self.length_m, distance_m + HALF_CHORD_M)
        if high_m - low_m < HALF_CHORD_M:
            return 0.0
        return wrap_angle(self.heading_rad(high_m) - self.heading_rad(low_m)) / (high_m - low_m)

    def speed_m_s(self, distance_m: float, fastest_m_s: float, turn_rad_s: float, accel: float) -> float:
        """Return the speed at which this bend, and all within the braking distance, can be driven."""
        speed = fastest_m_s
        for step_m in np.arange(0.0, 0.5 * fastest_m_s**2 / accel + HALF_CHORD_M, HALF_CHORD_M):
            bend_m_s = turn_rad_s / max(LEAST_CURVATURE, abs(self.curvature(distance_m + float(step_m))))
            speed = min(speed, math.sqrt(bend_m_s**2 + 2.0 * accel * float(step_m)))
        return speed


class TrajectoryTracker:
    """`Controller` by pose error and state feedback; drives only while the outline is free."""

    def __init__(
        self,
        options: TrajectoryTrackerOptions,
        rotation: RotateInPlaceOptions,
        limits: SpeedLimits,
        footprint: Footprint,
    ) -> None:
        self._side_gain = options.side_gain
        self._limits = limits
        self._rotation = RotationShim(rotation, limits, footprint)
        self._check = AdmissibilityCheck(limits, footprint)
        self._lead_m = 0.0  # of the reference before the robot

    def reset(self) -> None:
        """Forget the reference."""
        self._lead_m = 0.0
        self._rotation.reset()

    def rotate(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a rotation in place."""
        return self._rotation.rotate(request, angle_rad)

    def compute_command(self, request: ControlRequest) -> ControlResult:
        """Rotate toward the path, or track it; None if that is not free even at low speed."""
        limits, base = self._limits, self._predicted_base(request)
        reference = ReferenceTrajectory(request.path_m, base)
        angle_rad = wrap_angle(reference.heading_rad(0.0) - request.map_from_base.theta_rad)
        rotation = self._rotation.toward(request, angle_rad, enabled=reference.length_m > HALF_CHORD_M)
        if rotation is not None:
            return rotation
        turn_rad_s = TURN_FRACTION * limits.w_max_rad_s
        speed = reference.speed_m_s(self._lead_m, request.v_limit_m_s, turn_rad_s, limits.v_accel_m_s2)
        self._lead_m += (speed - request.twist.v_m_s) * request.period_s
        self._lead_m = min(max(self._lead_m, 0.0), MAX_LEAD_M)
        wanted = self._state_control(reference, base, speed)
        return self._check.first_admissible(request, self._candidates(request, wanted), "the tracked path")

    def _candidates(self, request: ControlRequest, wanted: Twist2) -> Iterator[Twist2]:
        """Yield commands toward the wanted twist, then toward slower ones."""
        limits, last, period_s = self._limits, request.last_command, request.period_s
        for fraction in SPEED_FRACTIONS:
            v_m_s = min(max(fraction * wanted.v_m_s, 0.0), request.v_limit_m_s)
            w_rad_s = fraction * wanted.w_rad_s
            yield Twist2(
                v_m_s=step_toward(last.v_m_s, v_m_s, limits.v_accel_m_s2 * period_s),
                w_rad_s=step_toward(last.w_rad_s, w_rad_s, limits.w_accel_rad_s2 * period_s),
            )

    def _predicted_base(self, request: ControlRequest) -> Pose2:
        """Return the robot's pose when this command takes effect."""
        twist, latency_s = request.twist, self._limits.latency_s
        turn_rad = twist.w_rad_s * latency_s
        distance_m = twist.v_m_s * latency_s
        return request.map_from_base @ Pose2(
            x_m=distance_m * math.cos(0.5 * turn_rad),
            y_m=distance_m * math.sin(0.5 * turn_rad),
            theta_rad=turn_rad,
        )

    def _state_control(self, reference: ReferenceTrajectory, base: Pose2, speed_m_s: float) -> Twist2:
        """Return the twist that drives the pose error to zero (control rule of Kanayama 1990)."""
        along_m, side_m = base.inverse().apply(reference.point(self._lead_m)[None, :])[0]
        error_rad = wrap_angle(reference.heading_rad(self._lead_m) - base.theta_rad)
        heading_gain = 2.0 * DAMPING * math.sqrt(self._side_gain)
        w_rad_s = speed_m_s * (
            reference.curvature(self._lead_m)
            + self._side_gain * float(side_m)
            + heading_gain * math.sin(error_rad)
        )
        limit = self._limits.w_max_rad_s
        return Twist2(
            v_m_s=speed_m_s * math.cos(error_rad) + ALONG_GAIN * float(along_m),
            w_rad_s=min(max(w_rad_s, -limit), limit),
        )


class SwitchingController:
    """`Controller` that uses the tracker where the path ahead has room, and another controller elsewhere."""

    def __init__(
        self,
        tracker: TrajectoryTracker,
        other: Controller,
        options: TrajectoryTrackerOptions,
        footprint: Footprint,
    ) -> None:
        self._tracker = tracker
        self._other = other
        self._ahead_m = options.free_ahead_m
        self._room_m = footprint.circumscribed_radius_m + options.free_room_m
        self._tracking = False

    def reset(self) -> None:
        """Forget the past in both."""
        self._tracker.reset()
        self._other.reset()

    def rotate(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a rotation in place."""
        return self._other.rotate(request, angle_rad)

    def compute_command(self, request: ControlRequest) -> ControlResult:
        """Return the tracker's twist; without room or a twist, the other controller's."""
        free = self._is_free(request)
        if free != self._tracking:
            (self._tracker if free else self._other).reset()
            self._tracking = free
        if free:
            result = self._tracker.compute_command(request)
            if result.command is not None:
                return result
        return self._other.compute_command(request)

    def _is_free(self, request: ControlRequest) -> bool:
        """Return whether robot and path ahead have room for the circumscribed circle and some more."""
        base, costmap = request.map_from_base, request.costmap
        path_m = ahead(request.path_m, base, self._ahead_m)
        path_m = path_m[arc_lengths(path_m) <= self._ahead_m]
        rows, cols = costmap.cells_of(np.vstack(((base.x_m, base.y_m), path_m)))
        inside = (rows >= 0) & (cols >= 0) & (rows < costmap.costs.shape[0]) & (cols < costmap.costs.shape[1])
        if not inside.all():
            return False
        least_cells = math.sqrt(float(costmap.squared_cells[rows, cols].min()))
        return least_cells * costmap.resolution_m >= self._room_m
