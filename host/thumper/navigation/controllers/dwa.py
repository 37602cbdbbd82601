"""Dynamic Window controller.

Fox, Burgard & Thrun, "The Dynamic Window Approach to Collision Avoidance" (1997), with the path-following
scores of ROS's dwa_local_planner in metres, so that their weights do not depend on the grid. A path that
leads off to the side or behind is met by turning on the spot first.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.dwa_kernels import (
    CLEARANCE,
    CUT,
    FRONT,
    GOAL,
    HITS,
    LEAVES_MAP,
    OPEN,
    PATH,
    measure,
    simulate,
)
from thumper.navigation.controllers.oscillation_flags import OscillationFlags
from thumper.navigation.controllers.rotate_in_place import RotateInPlace
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.footprint_collision import Ground
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.polyline import arc_lengths, nearest_index
from thumper.navigation.speed_limits import SpeedLimits, step_toward


@dataclass(frozen=True, slots=True, kw_only=True)
class DwaOptions:
    """How many commands are tried, how far they are thought ahead, and what makes one good."""

    # Forward speeds tried in each cycle.
    v_samples: Annotated[int, Ge(2)] = 7
    # Turn rates tried in each cycle; 0 is always among them.
    w_samples: Annotated[int, Ge(3)] = 21
    # Time thought ahead, latency included [s]; must exceed the time to stop from full speed.
    horizon_s: Annotated[float, Gt(0)] = 1.7
    # Longest step of the simulation [s]; shortened so that no step is longer than a cell.
    step_s: Annotated[float, Gt(0)] = 0.1
    # Part of the path that counts: from the robot to this far ahead [m]; its end is the local goal.
    lookahead_m: Annotated[float, Gt(0)] = 0.9
    # Weight of the mean distance from the path [1/m].
    path_weight: Annotated[float, Ge(0)] = 1.0
    # Weight of the distance left to the local goal [1/m].
    goal_weight: Annotated[float, Ge(0)] = 1.0
    # Weight of the distance from the path of a point ahead of the robot: keeps it pointing along the path
    # [1/m].
    front_weight: Annotated[float, Ge(0)] = 0.7
    # How far ahead that point is [m].
    front_m: Annotated[float, Gt(0)] = 0.25
    # Weight of nearness to obstacles (1 at the inscribed radius, decaying).
    obstacle_weight: Annotated[float, Ge(0)] = 0.15
    # Distance over which nearness decays to 1/e [m].
    obstacle_decay_m: Annotated[float, Gt(0)] = 0.08
    # Weight of the part of the horizon that a contact cuts off (the robot can stop, but not drive on).
    contact_weight: Annotated[float, Ge(0)] = 0.5
    # Weight of a change of turn rate against the last command [s/rad]; damps weaving.
    smooth_weight: Annotated[float, Ge(0)] = 0.02
    # Path direction off the robot's heading beyond which it turns on the spot first [rad] ...
    turn_start_rad: Annotated[float, Gt(0)] = 1.0
    # ... and below which it drives on [rad].
    turn_end_rad: Annotated[float, Gt(0)] = 0.25
    # After a reversal of the turn, turning back is forbidden until the robot has moved this far [m] ...
    oscillation_m: Annotated[float, Ge(0)] = 0.05
    # ... or turned this far [rad]; both 0 forbid nothing.
    oscillation_rad: Annotated[float, Ge(0)] = 0.2


class DwaController:
    """`Controller` by dynamic window."""

    def __init__(self, options: DwaOptions, limits: SpeedLimits, footprint: Footprint) -> None:
        stop_s = limits.latency_s + 0.5 * max(
            limits.v_max_m_s / limits.v_accel_m_s2, limits.w_max_rad_s / limits.w_accel_rad_s2
        )
        if options.horizon_s < stop_s + 4.0 * options.step_s:
            raise ThumperError(
                f"[navigation.dwa] horizon_s = {options.horizon_s} is too short to stop from full speed: "
                f"use at least {stop_s + 4.0 * options.step_s:.2f}",
                exit_code=EXIT_USAGE,
            )
        self._options = options
        self._limits = limits
        self._footprint = footprint
        self._turn = RotateInPlace(limits, footprint)
        self._turning = False
        self._flags = OscillationFlags(options.oscillation_m, options.oscillation_rad)

    def reset(self) -> None:
        """Forget that a turn was under way."""
        self._turning = False
        self._turn.reset()
        self._flags.reset()

    def turn(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a turn on the spot."""
        return self._turn.command(request, angle_rad)

    def command(self, request: ControlRequest) -> ControlResult:
        """Turn toward the path, or the best twist of the window; None when all of them hit something."""
        ahead_m = self._path_ahead(request.map_from_base, request.path_m)
        turn_rad = self._turn_to_path(request.map_from_base, ahead_m)
        limit_rad = self._options.turn_end_rad if self._turning else self._options.turn_start_rad
        self._turning = abs(turn_rad) > limit_rad
        if self._turning:
            result = self._turn.command(request, turn_rad)
            if result.command is not None:
                return result
        else:
            self._turn.reset()
        return self._best(request, ahead_m)

    def _path_ahead(self, map_from_base: Pose2, path_m: FloatArray) -> FloatArray:
        start = nearest_index(path_m, map_from_base.x_m, map_from_base.y_m)
        rest_m = path_m[start:]
        count = int(np.searchsorted(arc_lengths(rest_m), self._options.lookahead_m)) + 1
        return np.ascontiguousarray(rest_m[:count])

    def _turn_to_path(self, map_from_base: Pose2, ahead_m: FloatArray) -> float:
        """Angle from the robot's heading to the path's beginning; 0 when too little of it is left to tell."""
        index = int(np.searchsorted(arc_lengths(ahead_m), self._options.front_m))
        dx_m, dy_m = ahead_m[min(index, len(ahead_m) - 1)] - (map_from_base.x_m, map_from_base.y_m)
        if math.hypot(dx_m, dy_m) < 0.05:
            return 0.0
        return wrap_angle(math.atan2(dy_m, dx_m) - map_from_base.theta_rad)

    def _window(self, request: ControlRequest) -> FloatArray:
        """Commands (v, w) that the accelerations allow until the next cycle, shape (n, 2)."""
        limits, last = self._limits, request.last_command
        dv, dw = limits.v_accel_m_s2 * request.period_s, limits.w_accel_rad_s2 * request.period_s
        v_high = min(request.v_limit_m_s, max(0.0, last.v_m_s) + dv)
        v_low = min(v_high, max(0.0, last.v_m_s - dv))
        w_low = max(-limits.w_max_rad_s, last.w_rad_s - dw)
        w_high = min(limits.w_max_rad_s, last.w_rad_s + dw)
        v = np.linspace(v_low, v_high, self._options.v_samples)
        w = np.linspace(w_low, w_high, self._options.w_samples)
        w[np.argmin(np.abs(w))] = min(max(0.0, w_low), w_high)
        v_grid, w_grid = np.meshgrid(v, w, indexing="ij")
        return np.column_stack((v_grid.ravel(), w_grid.ravel()))

    def _best(self, request: ControlRequest, ahead_m: FloatArray) -> ControlResult:
        options, limits, costmap = self._options, self._limits, request.costmap
        commands = self._window(request)
        pose = np.array(
            (request.map_from_base.x_m, request.map_from_base.y_m, request.map_from_base.theta_rad)
        )
        twist = np.array((request.twist.v_m_s, request.twist.w_rad_s))
        # The outline check sees every obstacle only while a step is no longer than a cell.
        step_s = min(options.step_s, costmap.resolution_m / limits.v_max_m_s)
        motion = np.array((limits.v_accel_m_s2, limits.w_accel_rad_s2, limits.latency_s, step_s))
        steps = round(options.horizon_s / step_s)
        status, terms = measure(
            commands,
            pose,
            twist,
            motion,
            steps,
            Ground.of(costmap, self._footprint),
            ahead_m,
            options.front_m,
            request.period_s,
        )
        open_ = status == OPEN
        if not open_.any():
            return ControlResult(command=None, reason=_refusal(status, costmap))
        near = (self._footprint.inscribed_radius_m - terms[:, CLEARANCE]) / options.obstacle_decay_m
        score = (
            options.path_weight * terms[:, PATH]
            + options.goal_weight * terms[:, GOAL]
            + options.front_weight * terms[:, FRONT]
            + options.obstacle_weight * np.exp(np.minimum(near, 0.0))
            + options.contact_weight * terms[:, CUT]
            + options.smooth_weight * np.abs(commands[:, 1] - request.last_command.w_rad_s)
        )
        calm = open_ & self._flags.allowed(commands)
        best = int(np.argmin(np.where(calm if calm.any() else open_, score, np.inf)))
        command = self._first_step(request, commands[best])
        self._flags.update(command.w_rad_s, request.map_from_base)
        trajectory = np.empty((steps, 3))
        simulate(pose, twist, commands[best], motion, trajectory)
        return ControlResult(command=command, trajectory=trajectory)

    def _first_step(self, request: ControlRequest, chosen: FloatArray) -> Twist2:
        """What to drive for one period on the way to the chosen speeds: here they are within reach."""
        return Twist2(v_m_s=float(chosen[0]), w_rad_s=float(chosen[1]))


def _refusal(status: np.typing.NDArray[np.int64], costmap: Costmap) -> str:
    hits, leaves = int((status == HITS).sum()), int((status == LEAVES_MAP).sum())
    return f"all {status.size} motions are refused: {hits} hit an obstacle, {leaves} leave the map"


class TrajectoryRolloutController(DwaController):
    """`Controller` by rolling out the speeds of the whole horizon; takes the options of the dynamic
    window.
    """

    def _window(self, request: ControlRequest) -> FloatArray:
        limits, last, horizon_s = self._limits, request.last_command, self._options.horizon_s
        reach = limits.v_accel_m_s2 * horizon_s
        v_high = min(request.v_limit_m_s, max(0.0, last.v_m_s) + reach)
        v = np.linspace(min(v_high, max(0.0, last.v_m_s - reach)), v_high, self._options.v_samples)
        turn = limits.w_accel_rad_s2 * horizon_s
        w_low, w_high = (
            max(-limits.w_max_rad_s, last.w_rad_s - turn),
            min(limits.w_max_rad_s, last.w_rad_s + turn),
        )
        w = np.linspace(w_low, w_high, self._options.w_samples)
        w[np.argmin(np.abs(w))] = min(max(0.0, w_low), w_high)
        v_grid, w_grid = np.meshgrid(v, w, indexing="ij")
        return np.column_stack((v_grid.ravel(), w_grid.ravel()))

    def _first_step(self, request: ControlRequest, chosen: FloatArray) -> Twist2:
        """The speeds on the way to the chosen ones that can be had in one period."""
        limits, last = self._limits, request.last_command
        return Twist2(
            v_m_s=step_toward(last.v_m_s, float(chosen[0]), limits.v_accel_m_s2 * request.period_s),
            w_rad_s=step_toward(last.w_rad_s, float(chosen[1]), limits.w_accel_rad_s2 * request.period_s),
        )
