"""Dynamic Window Approach and Trajectory Rollout.

Fox, Burgard & Thrun, "The Dynamic Window Approach to Collision Avoidance" (1997), with the path-following
scores of ROS's dwa_local_planner in metres, so that their weights do not depend on the grid. Gerkey &
Konolige, "Planning and Control in Unstructured Terrain" (2008) for the rollout of the whole horizon.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray, Twist2
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.dwa_kernels import (
    CLEARANCE,
    CUT,
    FREE,
    FRONT,
    GOAL,
    LEAVES_MAP,
    PATH,
    RolloutTask,
    score_commands,
    simulate,
)
from thumper.navigation.controllers.oscillation_flags import OscillationFlags
from thumper.navigation.controllers.rotate_in_place import RotateInPlaceOptions, RotationShim, angle_to_path
from thumper.navigation.controllers.stopping_check import dynamics_of, motion_start
from thumper.navigation.costmap.footprint_collision import CollisionGrid
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.polyline import ahead
from thumper.navigation.speed_limits import SpeedLimits, step_toward

STEP_S = 0.1  # longest step of the simulation; shortened so that no step is longer than a cell
FRONT_WEIGHT = 0.7  # of the front point's distance from the path [1/m]
OBSTACLE_DECAY_M = 0.08  # distance over which the obstacle score falls to 1/e
CONTACT_WEIGHT = 0.5  # of the fraction of the horizon that a contact cuts off
SMOOTH_WEIGHT = 0.02  # of a change of turn rate against the last command [s/rad]; damps weaving


@dataclass(frozen=True, slots=True, kw_only=True)
class DwaOptions:
    """How many commands are simulated, how far, and how they are scored."""

    # Forward speeds sampled per cycle.
    v_samples: Annotated[int, Ge(2)] = 7
    # Turn rates sampled per cycle; 0 is always among them.
    w_samples: Annotated[int, Ge(3)] = 21
    # Simulated time, latency included [s]; must exceed the time to stop from full speed.
    horizon_s: Annotated[float, Gt(0)] = 1.7
    # Length of the path that is scored, from the robot on [m]; its end is the local goal.
    lookahead_m: Annotated[float, Gt(0)] = 0.9
    # Weight of the mean distance from the path [1/m].
    path_weight: Annotated[float, Ge(0)] = 1.0
    # Weight of the distance left to the local goal [1/m].
    goal_weight: Annotated[float, Ge(0)] = 1.0
    # Weight of the nearness to obstacles (1 at the inscribed radius, decaying).
    obstacle_weight: Annotated[float, Ge(0)] = 0.15


class DwaController:
    """`Controller` by dynamic window."""

    def __init__(
        self, options: DwaOptions, rotation: RotateInPlaceOptions, limits: SpeedLimits, footprint: Footprint
    ) -> None:
        stop_s = limits.latency_s + 0.5 * max(
            limits.v_max_m_s / limits.v_accel_m_s2, limits.w_max_rad_s / limits.w_accel_rad_s2
        )
        if options.horizon_s < stop_s + 4.0 * STEP_S:
            raise ThumperError(
                f"[navigation.dwa] horizon_s = {options.horizon_s} is too short to stop from full speed: "
                f"use at least {stop_s + 4.0 * STEP_S:.2f}",
                exit_code=EXIT_USAGE,
            )
        self._options = options
        self._limits = limits
        self._footprint = footprint
        self._rotation = RotationShim(rotation, limits, footprint)
        self._flags = OscillationFlags()

    def reset(self) -> None:
        """Forget rotation and oscillation."""
        self._rotation.reset()
        self._flags.reset()

    def rotate(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a rotation in place."""
        return self._rotation.rotate(request, angle_rad)

    def compute_command(self, request: ControlRequest) -> ControlResult:
        """Rotate toward the path, or return the window's best twist; None if none is admissible."""
        path_m = ahead(request.path_m, request.map_from_base, self._options.lookahead_m)
        rotation = self._rotation.toward(request, angle_to_path(path_m, request.map_from_base))
        return rotation or self._best(request, path_m)

    def _window(self, request: ControlRequest) -> FloatArray:
        """Return the commands (v, w) that the accelerations allow in the window's time, shape (n, 2)."""
        limits, last, reach_s = self._limits, request.last_command, self._window_s(request)
        dv, dw = limits.v_accel_m_s2 * reach_s, limits.w_accel_rad_s2 * reach_s
        v_high = min(request.v_limit_m_s, max(0.0, last.v_m_s) + dv)
        v_low = min(v_high, max(0.0, last.v_m_s - dv))
        w_low = max(-limits.w_max_rad_s, last.w_rad_s - dw)
        w_high = min(limits.w_max_rad_s, last.w_rad_s + dw)
        v = np.linspace(v_low, v_high, self._options.v_samples)
        w = np.linspace(w_low, w_high, self._options.w_samples)
        w[np.argmin(np.abs(w))] = min(max(0.0, w_low), w_high)
        v_grid, w_grid = np.meshgrid(v, w, indexing="ij")
        return np.column_stack((v_grid.ravel(), w_grid.ravel()))

    def _best(self, request: ControlRequest, path_m: FloatArray) -> ControlResult:
        options, costmap = self._options, request.costmap
        commands = self._window(request)
        # The outline check sees every obstacle only if no step is longer than a cell.
        step_s = min(STEP_S, costmap.resolution_m / self._limits.v_max_m_s)
        task = RolloutTask(
            start=motion_start(request),
            dynamics=dynamics_of(self._limits, step_s),
            steps=round(options.horizon_s / step_s),
            period_s=request.period_s,
            path_m=path_m,
            arrives=bool((path_m[-1] == request.path_m[-1]).all()),
        )
        status, terms = score_commands(task, commands, CollisionGrid.from_costmap(costmap, self._footprint))
        admissible = status == FREE
        if not admissible.any():
            return ControlResult(command=None, reason=_rejection(status))
        near = (self._footprint.inscribed_radius_m - terms[:, CLEARANCE]) / OBSTACLE_DECAY_M
        score = (
            options.path_weight * terms[:, PATH]
            + options.goal_weight * terms[:, GOAL]
            + FRONT_WEIGHT * terms[:, FRONT]
            + options.obstacle_weight * np.exp(np.minimum(near, 0.0))
            + CONTACT_WEIGHT * terms[:, CUT]
            + SMOOTH_WEIGHT * np.abs(commands[:, 1] - request.last_command.w_rad_s)
        )
        steady = admissible & self._flags.allowed(commands)
        best = int(np.argmin(np.where(steady if steady.any() else admissible, score, np.inf)))
        command = self._first_step(request, commands[best])
        self._flags.update(command.w_rad_s, request.map_from_base)
        trajectory = np.empty((task.steps, 3))
        simulate(task.start, commands[best], task.dynamics, trajectory)
        return ControlResult(command=command, trajectory=trajectory)

    def _window_s(self, request: ControlRequest) -> float:
        """Return the time within which a command of the window can be reached [s]."""
        return request.period_s

    def _first_step(self, request: ControlRequest, chosen: FloatArray) -> Twist2:
        """Return the command for one period: here the chosen speeds, which are within reach."""
        return Twist2(v_m_s=float(chosen[0]), w_rad_s=float(chosen[1]))


def _rejection(status: np.typing.NDArray[np.int64]) -> str:
    if (status == LEAVES_MAP).any():
        return "no free motion: blocked by obstacles and the edge of the map"
    return "no free motion: obstacles on all sides"


class TrajectoryRolloutController(DwaController):
    """`Controller` by rollout of all speeds reachable within the horizon; takes DWA's options."""

    def _window_s(self, request: ControlRequest) -> float:
        return self._options.horizon_s

    def _first_step(self, request: ControlRequest, chosen: FloatArray) -> Twist2:
        """Return the speeds on the way to the chosen ones that can be reached in one period."""
        limits, last = self._limits, request.last_command
        return Twist2(
            v_m_s=step_toward(last.v_m_s, float(chosen[0]), limits.v_accel_m_s2 * request.period_s),
            w_rad_s=step_toward(last.w_rad_s, float(chosen[1]), limits.w_accel_rad_s2 * request.period_s),
        )
