"""Give way to people: step aside, let them pass, or pass behind them.

If the wanted command comes too near to the predicted place of somebody, plans of three commands each are
simulated among the predictions, and the first command of the best one is driven.
"""

import math
from collections.abc import Callable
from itertools import product

import numpy as np

from thumper.common.geometry import FloatArray, Twist2
from thumper.navigation.controllers.controller import ControlRequest
from thumper.navigation.controllers.stopping_check import dynamics_of, motion_start, simulated_poses
from thumper.navigation.costmap.footprint_collision import CollisionGrid, lethal_count
from thumper.navigation.footprint import Footprint
from thumper.navigation.planners.polyline import ahead, arc_lengths, resample
from thumper.navigation.safety.give_way_kernels import (
    GiveWayTask,
    GiveWayWeights,
    first_conflict,
    score_plans,
)
from thumper.navigation.safety.tracks import STEP_S, STEPS
from thumper.navigation.speed_limits import SpeedLimits

AHEAD_S = 3.5  # a conflict later than this is none yet
LOOKAHEAD_M = 2.0  # of the path that counts
VERTEX_M = 0.1
MARGIN_M_S = 0.02  # predictions get worse by this much
ENDS = (8, 22, STEPS)  # steps at which the commands of a plan end
BACK_M_S = -0.2
# The commands of the plans, as parts of the highest speeds; NaN: toward the end of the path.
FIRST_V, FIRST_W = (-0.5, 0.0, 0.35, 0.7, 1.0), (-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0)
SECOND_V, SECOND_W = (-0.5, 0.0, 0.5, 1.0), (-0.8, -0.4, 0.0, 0.4, 0.8)
FRACTIONS = (
    tuple(product(FIRST_V, FIRST_W)),
    tuple(product(SECOND_V, SECOND_W)),
    ((0.0, math.nan), (1.0, math.nan), (1.0, 0.0), (0.5, 0.0)),
)
KEEP_BONUS_M = 0.3  # for the plan that was chosen last
WEIGHTS = GiveWayWeights(contact=18.0, near=0.5, static=5.0, heading=0.15, keep=KEEP_BONUS_M)
TRIED = 1500  # of the plans, best first, have their first command checked
RELEASE_MARGIN_M = 0.1  # more room than this before the controller drives again


class GiveWay:
    """Checks commands against the predictions, and finds others."""

    def __init__(self, limits: SpeedLimits, footprint: Footprint, *, margin_m: float) -> None:
        self._limits = limits
        self._footprint = footprint
        self._half_planes = footprint.half_planes()
        self._margin_m = margin_m
        self._last: FloatArray | None = None  # first and second command of the last plan, shape (2, 2)
        highest = (limits.v_max_m_s, limits.w_max_rad_s)
        slowest_m_s = (BACK_M_S, -math.inf)  # backward it is slow
        self._first, self._second, self._third = (
            np.maximum(np.array(fractions) * highest, slowest_m_s) for fractions in FRACTIONS
        )

    def is_in_conflict(self, command: Twist2, request: ControlRequest, discs: FloatArray) -> bool:
        """Return whether the command or the path soon comes too near to somebody.

        `discs` are those of `Tracks.predicted`. The path counts at full speed: a command slows down before
        somebody, and seems free for that reason alone.
        """
        if not discs.shape[1]:
            self._last = None
            return False
        count = round(AHEAD_S / STEP_S)
        margin_m = self._margin_m + (RELEASE_MARGIN_M if self._last is not None else 0.0)
        by_command = simulated_poses(request, command, self._limits, step_s=STEP_S, count=count)
        conflict = any(
            int(first_conflict(self._half_planes, discs, margin_m, poses)) < count
            for poses in (by_command, self._poses_on_path(request, count))
        )
        if not conflict:
            self._last = None
        return conflict

    def _poses_on_path(self, request: ControlRequest, count: int) -> FloatArray:
        """Return the poses of a robot that drives along the path as fast as it may, shape (count, 3)."""
        times_s = STEP_S * np.arange(1, count + 1)
        v_m_s = np.minimum(
            max(0.0, request.twist.v_m_s)
            + self._limits.v_accel_m_s2 * np.maximum(times_s - self._limits.latency_s, 0.0),
            request.v_limit_m_s,
        )
        path_m = ahead(request.path_m, request.map_from_base, max(LOOKAHEAD_M, AHEAD_S * request.v_limit_m_s))
        if len(path_m) < 2:
            base = request.map_from_base
            return np.tile((base.x_m, base.y_m, base.theta_rad), (count, 1))
        along_m, driven_m = arc_lengths(path_m), np.cumsum(v_m_s) * STEP_S
        segment = np.clip(np.searchsorted(along_m, driven_m, side="right") - 1, 0, len(path_m) - 2)
        dx, dy = np.diff(path_m, axis=0)[segment].T
        x_m, y_m = (np.interp(driven_m, along_m, path_m[:, axis]) for axis in (0, 1))
        return np.column_stack((x_m, y_m, np.arctan2(dy, dx)))

    def best_command(
        self, request: ControlRequest, discs: FloatArray, allowed: Callable[[Twist2], Twist2 | None]
    ) -> Twist2:
        """Return the first command of the best plan for which there is one that is allowed; zero if none is.

        `allowed` returns the command that may be driven instead of one, or None.
        """
        first, second = self._first, self._second
        costs = score_plans(self._task(request, discs), first, second, self._third, ENDS)
        if self._last is not None:
            change = [
                np.abs(commands - last).sum(axis=1)
                for commands, last in zip((first, second), self._last, strict=True)
            ]
            costs -= KEEP_BONUS_M * np.exp(-np.add.outer(*change))[..., None]
        tried: set[int] = set()
        for index in np.argsort(costs, axis=None)[:TRIED]:
            one, two, _ = (int(number) for number in np.unravel_index(index, costs.shape))
            if one in tried:
                continue
            tried.add(one)
            v_m_s, w_rad_s = (float(value) for value in first[one])
            command = allowed(Twist2(v_m_s=min(v_m_s, request.v_limit_m_s), w_rad_s=w_rad_s))
            if command is not None:
                self._last = np.array((first[one], second[two]))
                return command
        return Twist2()

    def _task(self, request: ControlRequest, discs: FloatArray) -> GiveWayTask:
        path_m = resample(ahead(request.path_m, request.map_from_base, LOOKAHEAD_M), VERTEX_M)
        along_m, start = arc_lengths(path_m), motion_start(request)
        grid = CollisionGrid.from_costmap(request.costmap, self._footprint)
        return GiveWayTask(
            start=start,
            sent=(request.last_command.v_m_s, request.last_command.w_rad_s),
            dynamics=dynamics_of(self._limits, STEP_S),
            half_planes=self._half_planes,
            discs=discs,
            margin_m=self._margin_m,
            margin_m_s=MARGIN_M_S,
            path_m=path_m,
            left_m=along_m[-1] - along_m,
            w_max=self._limits.w_max_rad_s,
            grid=grid,
            touching=max(0, lethal_count(grid, False, start.x, start.y, start.theta)),
            weights=WEIGHTS,
        )
