"""Model predictive path integral control: the mean of many noisy futures, weighted by how cheap they are.

Williams et al., "Aggressive Driving with Model Predictive Path Integral Control" (2016).
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray, Twist2, wrap_angle
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.mppi_kernels import score_futures, weighted_mean
from thumper.navigation.controllers.rotate_in_place import RotateInPlace
from thumper.navigation.controllers.stopping_check import AdmissibilityCheck
from thumper.navigation.costmap.footprint_collision import Ground
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.polyline import arc_lengths, nearest_index
from thumper.navigation.speed_limits import SpeedLimits, step_toward

SLOWER = (1.0, 0.5, 0.0)  # parts of the command tried until it leaves room to stop
POOL = 8  # sets of noise drawn once and used in turn: drawing costs more than driving


@dataclass(frozen=True, slots=True, kw_only=True)
class MppiOptions:
    """How many futures, how noisy, and what makes one good."""

    # Futures in each cycle.
    futures: Annotated[int, Ge(10)] = 1000
    # Steps of a future.
    steps: Annotated[int, Ge(10)] = 56
    # Length of a step [s].
    step_s: Annotated[float, Gt(0)] = 0.05
    # Spread of the forward speed [m/s]; more explores more and wobbles more.
    v_std_m_s: Annotated[float, Gt(0)] = 0.15
    # Spread of the turn rate [rad/s].
    w_std_rad_s: Annotated[float, Gt(0)] = 0.5
    # Cost difference at which a future's vote falls to 1/e; less follows the best future alone.
    temperature: Annotated[float, Gt(0)] = 0.02
    # Part of the path that counts [m].
    lookahead_m: Annotated[float, Gt(0)] = 1.2
    # Weight of the mean distance from the path [1/m].
    path_weight: Annotated[float, Ge(0)] = 1.0
    # Weight of the distance left to the end of that part [1/m].
    goal_weight: Annotated[float, Ge(0)] = 1.0
    # Weight of nearness to obstacles (1 at the inscribed radius, decaying).
    obstacle_weight: Annotated[float, Ge(0)] = 0.6
    # Weight of a contact, more the sooner it comes.
    contact_weight: Annotated[float, Ge(0)] = 3.0
    # Weight of the distance from the path of a point ahead of the last pose [1/m].
    front_weight: Annotated[float, Ge(0)] = 0.5
    # Path direction off the robot's heading beyond which it turns on the spot first [rad] ...
    turn_start_rad: Annotated[float, Gt(0)] = 1.0
    # ... and below which it drives on [rad].
    turn_end_rad: Annotated[float, Gt(0)] = 0.25
    # Seed of the noise: the same seed gives the same drive.
    seed: Annotated[int, Ge(0)] = 0


class MppiController:
    """`Controller` by sampled futures."""

    def __init__(self, options: MppiOptions, limits: SpeedLimits, footprint: Footprint) -> None:
        self._options = options
        self._limits = limits
        self._footprint = footprint
        self._turn = RotateInPlace(limits, footprint)
        self._check = AdmissibilityCheck(limits, footprint)
        shape = (POOL, options.futures, options.steps, 2)
        spread = np.array((options.v_std_m_s, options.w_std_rad_s), np.float32)
        drawn = np.random.default_rng(options.seed).standard_normal(shape, np.float32) * spread
        drawn[:, 0] = 0.0  # the mean itself is one of the futures
        self._noise = drawn
        self.reset()

    def reset(self) -> None:
        """Forget the last plan."""
        self._mean = np.zeros((self._options.steps, 2))
        self._turning = False
        self._cycle = 0
        self._turn.reset()

    def turn(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a turn on the spot."""
        return self._turn.command(request, angle_rad)

    def command(self, request: ControlRequest) -> ControlResult:
        """Turn toward the path, or the first step of the mean future; None when it leaves no room to stop."""
        ahead_m = self._path_ahead(request)
        turn_rad = self._turn_to_path(request, ahead_m)
        limit_rad = self._options.turn_end_rad if self._turning else self._options.turn_start_rad
        self._turning = abs(turn_rad) > limit_rad
        if self._turning:
            result = self._turn.command(request, turn_rad)
            if result.command is not None:
                return result
        else:
            self._turn.reset()
        self._improve(request, ahead_m)
        delay = min(len(self._mean) - 1, round(self._limits.latency_s / self._options.step_s))
        limits, last, period_s = self._limits, request.last_command, request.period_s
        v_m_s, w_rad_s = float(self._mean[delay, 0]), float(self._mean[delay, 1])
        refused = ""
        for part in SLOWER:
            command = Twist2(
                v_m_s=step_toward(last.v_m_s, part * v_m_s, limits.v_accel_m_s2 * period_s),
                w_rad_s=step_toward(last.w_rad_s, part * w_rad_s, limits.w_accel_rad_s2 * period_s),
            )
            refused, trajectory = self._check.refusal(request, command)
            if not refused:
                return ControlResult(command=command, trajectory=trajectory)
        return ControlResult(command=None, reason=f"the mean of {self._options.futures} futures {refused}")

    def _improve(self, request: ControlRequest, ahead_m: FloatArray) -> None:
        options, limits, costmap, base = self._options, self._limits, request.costmap, request.map_from_base
        shift = max(1, round(request.period_s / options.step_s))
        self._mean = np.vstack((self._mean[shift:], np.repeat(self._mean[-1:], shift, axis=0)))
        driven = self._noise[self._cycle % POOL].copy()
        self._cycle += 1
        totals = score_futures(
            driven,
            self._mean,
            np.array((base.x_m, base.y_m, base.theta_rad, request.twist.v_m_s, request.twist.w_rad_s)),
            np.array(
                (
                    request.v_limit_m_s,
                    limits.w_max_rad_s,
                    limits.v_accel_m_s2,
                    limits.w_accel_rad_s2,
                    limits.latency_s,
                    options.step_s,
                )
            ),
            Ground.of(costmap, self._footprint),
            ahead_m,
            np.array(
                (
                    options.path_weight,
                    options.goal_weight,
                    options.obstacle_weight,
                    options.contact_weight,
                    options.front_weight,
                )
            ),
            self._footprint.inscribed_radius_m,
        )
        self._mean = weighted_mean(driven, totals, options.temperature)

    def _path_ahead(self, request: ControlRequest) -> FloatArray:
        base = request.map_from_base
        rest_m = request.path_m[nearest_index(request.path_m, base.x_m, base.y_m) :]
        count = int(np.searchsorted(arc_lengths(rest_m), self._options.lookahead_m)) + 1
        return np.ascontiguousarray(rest_m[:count])

    def _turn_to_path(self, request: ControlRequest, ahead_m: FloatArray) -> float:
        base = request.map_from_base
        index = min(int(np.searchsorted(arc_lengths(ahead_m), 0.25)), len(ahead_m) - 1)
        dx_m, dy_m = ahead_m[index] - (base.x_m, base.y_m)
        if math.hypot(dx_m, dy_m) < 0.05:
            return 0.0
        return wrap_angle(math.atan2(dy_m, dx_m) - base.theta_rad)
