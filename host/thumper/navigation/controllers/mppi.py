"""Model predictive path integral control: the mean of noisy command sequences, weighted by cost.

Williams et al., "Aggressive Driving with Model Predictive Path Integral Control" (2016).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray, Twist2
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.mppi_kernels import (
    MppiTask,
    MppiWeights,
    NoiseArray,
    score_sequences,
    weighted_mean,
)
from thumper.navigation.controllers.rotate_in_place import RotateInPlaceOptions, RotationShim, angle_to_path
from thumper.navigation.controllers.stopping_check import AdmissibilityCheck, dynamics_of, motion_start
from thumper.navigation.costmap.footprint_collision import CollisionGrid
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.polyline import ahead
from thumper.navigation.speed_limits import SpeedLimits, step_toward

SPEED_FRACTIONS = (1.0, 0.5, 0.0)  # tried until the command leaves room to stop
NOISE_SETS = 8  # drawn once and used in turn: drawing takes longer than scoring
STEP_S = 0.05
LOOKAHEAD_M = 1.2  # length of the path that is scored
CONTACT_WEIGHT, FRONT_WEIGHT = 3.0, 0.5  # see `MppiWeights`
SEED = 0  # the same noise, and so the same drive, in every run


@dataclass(frozen=True, slots=True, kw_only=True)
class MppiOptions:
    """How many command sequences, how noisy, and how they are scored."""

    # Command sequences per cycle.
    futures: Annotated[int, Ge(10)] = 1000
    # Steps of a sequence, 0.05 s each.
    steps: Annotated[int, Ge(10)] = 56
    # Standard deviation of the forward speed [m/s]; more explores more and wobbles more.
    v_std_m_s: Annotated[float, Gt(0)] = 0.15
    # Standard deviation of the turn rate [rad/s].
    w_std_rad_s: Annotated[float, Gt(0)] = 0.5
    # Cost difference at which a sequence's weight falls to 1/e; less follows the best sequence alone.
    temperature: Annotated[float, Gt(0)] = 0.02
    # Weight of the mean distance from the path [1/m].
    path_weight: Annotated[float, Ge(0)] = 1.0
    # Weight of the distance left to the end of the scored path [1/m].
    goal_weight: Annotated[float, Ge(0)] = 1.0
    # Weight of the nearness to obstacles (1 at the inscribed radius, decaying).
    obstacle_weight: Annotated[float, Ge(0)] = 0.6


class MppiController:
    """`Controller` by sampled command sequences."""

    def __init__(
        self, options: MppiOptions, rotation: RotateInPlaceOptions, limits: SpeedLimits, footprint: Footprint
    ) -> None:
        self._options = options
        self._limits = limits
        self._footprint = footprint
        self._rotation = RotationShim(rotation, limits, footprint)
        self._check = AdmissibilityCheck(limits, footprint)
        self._noise = _drawn_noise(options)
        self._mean: FloatArray = np.zeros((options.steps, 2))
        self._cycle = 0

    def reset(self) -> None:
        """Forget the last command sequence."""
        self._mean = np.zeros((self._options.steps, 2))
        self._cycle = 0
        self._rotation.reset()

    def rotate(self, request: ControlRequest, angle_rad: float) -> ControlResult:
        """Return the next twist of a rotation in place."""
        return self._rotation.rotate(request, angle_rad)

    def compute_command(self, request: ControlRequest) -> ControlResult:
        """Rotate toward the path, or drive the mean sequence; None if it leaves no room to stop."""
        path_m = ahead(request.path_m, request.map_from_base, LOOKAHEAD_M)
        rotation = self._rotation.toward(request, angle_to_path(path_m, request.map_from_base))
        if rotation is not None:
            return rotation
        self._improve(request, path_m)
        what = f"the mean of {self._options.futures} command sequences"
        return self._check.first_admissible(request, self._candidates(request), what)

    def _candidates(self, request: ControlRequest) -> Iterator[Twist2]:
        """Yield the mean sequence's first command after the latency, then slower ones."""
        limits, last, period_s = self._limits, request.last_command, request.period_s
        delay = min(len(self._mean) - 1, round(limits.latency_s / STEP_S))
        v_m_s, w_rad_s = float(self._mean[delay, 0]), float(self._mean[delay, 1])
        for fraction in SPEED_FRACTIONS:
            yield Twist2(
                v_m_s=step_toward(last.v_m_s, fraction * v_m_s, limits.v_accel_m_s2 * period_s),
                w_rad_s=step_toward(last.w_rad_s, fraction * w_rad_s, limits.w_accel_rad_s2 * period_s),
            )

    def _improve(self, request: ControlRequest, path_m: FloatArray) -> None:
        """Shift the mean sequence by one period and average new sequences round it."""
        options, limits = self._options, self._limits
        shift = max(1, round(request.period_s / STEP_S))
        self._mean = np.vstack((self._mean[shift:], np.repeat(self._mean[-1:], shift, axis=0)))
        commands = self._noise[self._cycle % NOISE_SETS].copy()
        self._cycle += 1
        task = MppiTask(
            start=motion_start(request),
            dynamics=dynamics_of(limits, STEP_S),
            v_max=request.v_limit_m_s,
            w_max=limits.w_max_rad_s,
            path_m=path_m,
            inscribed_m=self._footprint.inscribed_radius_m,
        )
        weights = MppiWeights(
            path=options.path_weight,
            goal=options.goal_weight,
            obstacle=options.obstacle_weight,
            contact=CONTACT_WEIGHT,
            front=FRONT_WEIGHT,
        )
        grid = CollisionGrid.from_costmap(request.costmap, self._footprint)
        totals = score_sequences(task, weights, commands, self._mean, grid)
        self._mean = weighted_mean(commands, totals, options.temperature)


def _drawn_noise(options: MppiOptions) -> NoiseArray:
    """Return the noise of all cycles, shape (NOISE_SETS, futures, steps, 2)."""
    shape = (NOISE_SETS, options.futures, options.steps, 2)
    std = np.array((options.v_std_m_s, options.w_std_rad_s), np.float32)
    drawn: NoiseArray = np.random.default_rng(SEED).standard_normal(shape, np.float32) * std
    drawn[:, 0] = 0.0  # the mean itself is one of the sequences
    return drawn
