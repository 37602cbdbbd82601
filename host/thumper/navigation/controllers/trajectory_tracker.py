"""The trajectory tracker: a reference runs along the path, a state controller drives its pose error to zero.

The cascade of the thesis this robot comes from: trajectory, pose error, state controller, wheel speeds. The
law is Kanayama et al., "A stable tracking control method for an autonomous mobile robot" (1990):
v = v_r cos(e_theta) + k_x e_x, w = w_r + v_r (k_y e_y + k_theta sin(e_theta)); the errors are those of the
pose that the robot will have when it obeys.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.navigation.controllers.controller import Controller, ControlRequest, ControlResult
from thumper.navigation.controllers.rotate_in_place import RotateInPlace
from thumper.navigation.controllers.stopping_check import AdmissibilityCheck
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.polyline import arc_lengths, nearest_index, nearest_place
from thumper.navigation.speed_limits import SpeedLimits, step_toward

SLOWER = (1.0, 0.7, 0.45, 0.25)  # parts of the speed tried until the way is open
HALF_CHORD_M = 0.10  # heading and bend of the path are taken over twice this length
MOST_LEAD_M = 0.10  # the reference waits for a robot that falls back further
LEAST_BEND = 1e-6  # [1/m]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrajectoryTrackerOptions:
    """Gains of the state controller, and when the trajectory slows down."""

    # Answer to an error along the path [1/s].
    along_gain: Annotated[float, Gt(0)] = 1.0
    # Answer to an error across the path [1/m^2]; the robot closes it over 1/sqrt(gain) metres.
    side_gain: Annotated[float, Gt(0)] = 15.0
    # Damping of that; the heading's gain is 2 damping sqrt(side_gain) [-].
    damping: Annotated[float, Gt(0)] = 1.0
    # Part of the fastest turn that the trajectory may use in bends; the rest is left to the controller [-].
    turn_part: Annotated[float, Gt(0)] = 0.7
    # Path direction off the robot's heading beyond which it turns on the spot first [rad] ...
    turn_start_rad: Annotated[float, Gt(0)] = 1.0
    # ... and below which it drives on [rad].
    turn_end_rad: Annotated[float, Gt(0)] = 0.25
    # Way ahead that must be free for this tracker to take over from the controller [m].
    free_ahead_m: Annotated[float, Gt(0)] = 1.0
    # Room beyond the robot's circumscribed circle on all that way [m].
    free_room_m: Annotated[float, Ge(0)] = 0.08


class Reference:
    """A path as a trajectory: pose, bend and speed at a way along it, which counts from the robot on."""

    def __init__(self, path_m: FloatArray, base: Pose2) -> None:
        segment, passed_m = nearest_place(path_m, base.x_m, base.y_m)
        self._path_m = path_m[segment:]
        self._along_m = arc_lengths(self._path_m) - passed_m
        self.length_m = float(self._along_m[-1])

    def point(self, way_m: float) -> FloatArray:
        """Place at a way along the path, shape (2,) [m]."""
        return np.array([np.interp(way_m, self._along_m, self._path_m[:, axis]) for axis in (0, 1)])

    def heading_rad(self, way_m: float) -> float:
        """Direction of the path there."""
        first_m = float(self._along_m[0])
        low_m = min(max(first_m, way_m - HALF_CHORD_M), max(first_m, self.length_m - HALF_CHORD_M))
        dx_m, dy_m = self.point(max(way_m, low_m) + HALF_CHORD_M) - self.point(low_m)
        return math.atan2(dy_m, dx_m)

    def bend(self, way_m: float) -> float:
        """Curvature there, to the left positive [1/m]."""
        low_m, high_m = max(0.0, way_m - HALF_CHORD_M), min(self.length_m, way_m + HALF_CHORD_M)
        if high_m - low_m < HALF_CHORD_M:
            return 0.0
        return wrap_angle(self.heading_rad(high_m) - self.heading_rad(low_m)) / (high_m - low_m)

    def speed_m_s(self, way_m: float, fastest_m_s: float, turn_rad_s: float, accel: float) -> float:
        """Speed at which this bend, and every one within the braking way, can be driven."""
        speed = fastest_m_s
        for step_m in np.arange(0.0, 0.5 * fastest_m_s**2 / accel + HALF_CHORD_M, HALF_CHORD_M):
            bend_m_s = turn_rad_s / max(LEAST_BEND, abs(self.bend(way_m + float(step_m))))
            speed = min(speed, math.sqrt(bend_m_s**2 + 2.0 * accel * float(step_m)))
        return speed


class TrajectoryTracker:
    """`Controller` by pose error and state feedback; driven only while the outline stays free."""

    def __init__(self, options: TrajectoryTrackerOptions, limits: SpeedLimits, footprint: Footprint) -> None:
        self._options = options
        self._limits = limits
        self._turn = RotateInPlace(limits, footprint)
        self._check = AdmissibilityCheck(limits, footprint)
        self.reset()

    def reset(self) -> None:
        """Forget the reference."""
        self._lead_m = 0.0
        self._turning = False
        self._turn.reset()

    def turn(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a turn on the spot."""
        return self._turn.command(request, angle_rad)

    def command(self, request: ControlRequest) -> ControlResult:
        """Turn toward the path, or track it; None when that is not free even slowly."""
        options, limits, period_s = self._options, self._limits, request.period_s
        base = self._obeying(request)
        reference = Reference(request.path_m, base)
        off_rad = wrap_angle(reference.heading_rad(0.0) - request.map_from_base.theta_rad)
        limit_rad = options.turn_end_rad if self._turning else options.turn_start_rad
        self._turning = abs(off_rad) > limit_rad and reference.length_m > HALF_CHORD_M
        if self._turning:
            result = self._turn.command(request, off_rad)
            if result.command is not None:
                return result
        else:
            self._turn.reset()
        fastest_m_s, turn_rad_s = request.v_limit_m_s, options.turn_part * limits.w_max_rad_s
        speed = reference.speed_m_s(self._lead_m, fastest_m_s, turn_rad_s, limits.v_accel_m_s2)
        self._lead_m += (speed - request.twist.v_m_s) * period_s
        self._lead_m = min(max(self._lead_m, 0.0), MOST_LEAD_M)
        wanted = self._state_control(reference, base, speed)
        refused = ""
        for part in SLOWER:
            v_m_s = min(max(part * wanted.v_m_s, 0.0), request.v_limit_m_s)
            command = Twist2(
                v_m_s=step_toward(request.last_command.v_m_s, v_m_s, limits.v_accel_m_s2 * period_s),
                w_rad_s=step_toward(
                    request.last_command.w_rad_s, part * wanted.w_rad_s, limits.w_accel_rad_s2 * period_s
                ),
            )
            refused, trajectory = self._check.refusal(request, command)
            if not refused:
                return ControlResult(command=command, trajectory=trajectory)
        return ControlResult(command=None, reason=f"the tracked way {refused}")

    def _obeying(self, request: ControlRequest) -> Pose2:
        """Where the robot will be when it obeys this command."""
        twist, late_s = request.twist, self._limits.latency_s
        turn_rad = twist.w_rad_s * late_s
        way_m = twist.v_m_s * late_s
        return request.map_from_base @ Pose2(
            x_m=way_m * math.cos(0.5 * turn_rad), y_m=way_m * math.sin(0.5 * turn_rad), theta_rad=turn_rad
        )

    def _state_control(self, reference: Reference, base: Pose2, speed_m_s: float) -> Twist2:
        """The twist that brings the pose error to zero."""
        options = self._options
        along_m, side_m = base.inverse().apply(reference.point(self._lead_m)[None, :])[0]
        error_rad = wrap_angle(reference.heading_rad(self._lead_m) - base.theta_rad)
        heading_gain = 2.0 * options.damping * math.sqrt(options.side_gain)
        w_rad_s = speed_m_s * (
            reference.bend(self._lead_m)
            + options.side_gain * float(side_m)
            + heading_gain * math.sin(error_rad)
        )
        limit = self._limits.w_max_rad_s
        return Twist2(
            v_m_s=speed_m_s * math.cos(error_rad) + options.along_gain * float(along_m),
            w_rad_s=min(max(w_rad_s, -limit), limit),
        )


class SwitchingController:
    """`Controller` that looks at the room along the path and hands over."""

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

    def turn(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a turn on the spot."""
        return self._other.turn(request, angle_rad)

    def command(self, request: ControlRequest) -> ControlResult:
        """Return what the controller in charge says; a tracker that finds no way hands over."""
        free = self._is_free(request)
        if free != self._tracking:
            (self._tracker if free else self._other).reset()
            self._tracking = free
        if free:
            result = self._tracker.command(request)
            if result.command is not None:
                return result
        return self._other.command(request)

    def _is_free(self, request: ControlRequest) -> bool:
        """Whether the robot, and the path ahead, have room for its circle and some more."""
        base, costmap = request.map_from_base, request.costmap
        rest_m = request.path_m[nearest_index(request.path_m, base.x_m, base.y_m) :]
        ahead_m = rest_m[arc_lengths(rest_m) <= self._ahead_m]
        rows, cols = costmap.cells_of(np.vstack(((base.x_m, base.y_m), ahead_m)))
        inside = (rows >= 0) & (cols >= 0) & (rows < costmap.costs.shape[0]) & (cols < costmap.costs.shape[1])
        if not inside.all():
            return False
        least_cells = math.sqrt(float(costmap.squared_cells[rows, cols].min()))
        return least_cells * costmap.resolution_m >= self._room_m
