"""Threads a tight place: plans poses for the whole outline and drives them one after the other, slowly.

Where a corridor is hardly wider than the robot, a controller that scores twists of the next second sees only
that every one of them is bad: the way out may begin with a step back.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray, Twist2, wrap_angle
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.dwa_kernels import simulate
from thumper.navigation.controllers.rotate_in_place import SLOWEST_TURN_RAD_S, is_open
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.lattice import LatticePlanner
from thumper.navigation.speed_limits import SpeedLimits, step_toward, stoppable_speed

SIDE_GAIN, HEADING_GAIN = 20.0, 9.0  # [1/m^2], [1/m]: critically damped over about a quarter of a metre
AT_POSE_M, AT_POSE_RAD = 0.01, 0.06
FASTEST_TURN_RAD_S = 0.8
ROOM_M = 0.03  # beyond the outline's circle: enough for any controller
SAME_PLACE_M = 1e-6
SLOWEST_M_S = 0.05
STEP_S = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class TightPassageOptions:
    """When and how the robot threads its way."""

    # Time that the controller stands still although there is a path, before a manoeuvre is planned [s].
    after_s: Annotated[float, Gt(0)] = 0.8
    # Speed in a manoeuvre [m/s].
    v_m_s: Annotated[float, Gt(0)] = 0.12
    # Way driven pose by pose before the controller is tried again [m]; 0 never threads.
    length_m: Annotated[float, Ge(0)] = 0.8
    # Distance from the planned poses at which the manoeuvre is given up [m].
    stray_m: Annotated[float, Gt(0)] = 0.08


class PoseSequenceFollower:
    """One manoeuvre at a time: `begin`, then `step` until it returns None."""

    def __init__(
        self, options: TightPassageOptions, limits: SpeedLimits, footprint: Footprint, lattice: LatticePlanner
    ) -> None:
        self._options = options
        self._limits = limits
        self._footprint = footprint
        self._lattice = lattice
        self.active = self.is_whole = False

    def begin(self, request: ControlRequest, goal: Goal, *, through: bool) -> bool:
        """Plan; False when no poses lead to the goal, or there is nothing to drive.

        A way that only leads `through` a tight place is over when that is behind.
        """
        if self._options.length_m == 0.0:
            return False
        poses = self._lattice.poses(request.costmap, request.map_from_base, goal)
        if len(poses) < 2:
            return False
        way_m = np.concatenate((np.zeros(1), np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))))
        self._poses = poses[: max(2, int(np.searchsorted(way_m, self._options.length_m)) + 1)]
        self.is_whole = len(self._poses) == len(poses)  # it leads to the goal, not only toward it
        self._index = 0
        self._through, self._was_tight = through, False
        self.active = True
        return True

    def drop(self) -> None:
        """Give it up."""
        self.active = False

    def step(self, request: ControlRequest) -> ControlResult | None:
        """Return the next twist; None when the tight place or the last pose is behind, or it has strayed."""
        tight = not self._has_room(request)
        is_behind = self._through and self._was_tight and not tight
        self._was_tight |= tight
        wanted = None if is_behind else self._wanted(request)
        if wanted is None:
            self.active = False
            return None
        limits, period_s, last = self._limits, request.period_s, request.last_command
        v_m_s = step_toward(last.v_m_s, wanted.v_m_s, limits.v_accel_m_s2 * period_s)
        w_rad_s = step_toward(last.w_rad_s, wanted.w_rad_s, limits.w_accel_rad_s2 * period_s)
        ahead = self._stopping_poses(request, v_m_s, w_rad_s)
        start = request.map_from_base
        if not is_open(request.costmap, self._footprint, ahead, start, unknown_blocks=False):
            return ControlResult(command=None, reason="the way through the tight place is not free")
        return ControlResult(command=Twist2(v_m_s=v_m_s, w_rad_s=w_rad_s), trajectory=self._poses)

    def _has_room(self, request: ControlRequest) -> bool:
        """Whether the robot could turn on the spot here, with some room to spare."""
        base, costmap = request.map_from_base, request.costmap
        rows, cols = costmap.cells_of(np.array(((base.x_m, base.y_m),)))
        room_m = math.sqrt(float(costmap.squared_cells[rows[0], cols[0]])) * costmap.resolution_m
        return room_m >= self._footprint.circumscribed_radius_m + ROOM_M

    def _stopping_poses(self, request: ControlRequest, v_m_s: float, w_rad_s: float) -> FloatArray:
        """Where the command leads until the robot could stand, shape (n, 3)."""
        limits = self._limits
        braking_s = 0.5 * max(abs(v_m_s) / limits.v_accel_m_s2, abs(w_rad_s) / limits.w_accel_rad_s2)
        poses = np.empty((math.ceil((limits.latency_s + request.period_s + braking_s) / STEP_S), 3))
        base = request.map_from_base
        simulate(
            np.array((base.x_m, base.y_m, base.theta_rad)),
            np.array((request.twist.v_m_s, request.twist.w_rad_s)),
            np.array((v_m_s, w_rad_s)),
            np.array((limits.v_accel_m_s2, limits.w_accel_rad_s2, limits.latency_s, STEP_S)),
            poses,
        )
        return poses

    def _wanted(self, request: ControlRequest) -> Twist2 | None:
        base = request.map_from_base
        while self._index < len(self._poses) - 1:
            here, there = self._poses[self._index], self._poses[self._index + 1]
            step_m, turn_rad = there[:2] - here[:2], float(there[2] - here[2])
            length_m = math.hypot(*step_m)
            if length_m < SAME_PLACE_M:
                wanted = self._turn(base.theta_rad, float(there[2]), turn_rad)
            else:
                offset_m = np.array((base.x_m, base.y_m)) - here[:2]
                along_m = float(offset_m @ step_m) / length_m
                if (
                    math.dist((base.x_m, base.y_m), here[:2] + step_m * along_m / length_m)
                    > self._options.stray_m
                ):
                    return None
                wanted = self._drive(base.theta_rad, offset_m, along_m, here, step_m, turn_rad)
            if wanted is not None:
                return wanted
            self._index += 1
        return None

    def _turn(self, theta_rad: float, target_rad: float, turn_rad: float) -> Twist2 | None:
        left_rad = wrap_angle(target_rad - theta_rad) * math.copysign(1.0, turn_rad)
        if left_rad < AT_POSE_RAD:
            return None
        left_rad += self._same_turn_rad(turn_rad)
        speed = stoppable_speed(left_rad, self._limits.w_accel_rad_s2, self._limits.latency_s)
        speed = min(speed, FASTEST_TURN_RAD_S, self._limits.w_max_rad_s)
        return Twist2(w_rad_s=math.copysign(max(SLOWEST_TURN_RAD_S, speed), turn_rad))

    def _same_turn_rad(self, turn_rad: float) -> float:
        """Turn after the next pose that goes on in the same direction without a stop [rad]."""
        total_rad = 0.0
        for here, there in zip(self._poses[self._index + 1 :], self._poses[self._index + 2 :], strict=False):
            further_rad = float(there[2] - here[2])
            if math.dist(here[:2], there[:2]) > SAME_PLACE_M or further_rad * turn_rad <= 0.0:
                break
            total_rad += abs(further_rad)
        return total_rad

    def _drive(
        self,
        theta_rad: float,
        offset_m: FloatArray,
        along_m: float,
        here: FloatArray,
        step_m: FloatArray,
        turn_rad: float,
    ) -> Twist2 | None:
        length_m = math.hypot(*step_m)
        left_m = length_m - along_m
        if left_m < AT_POSE_M:
            return None
        part = min(1.0, max(0.0, along_m / length_m))
        heading_rad = float(here[2]) + part * turn_rad
        off_m = offset_m - part * step_m
        side_m = -math.sin(heading_rad) * off_m[0] + math.cos(heading_rad) * off_m[1]
        error_rad = wrap_angle(theta_rad - heading_rad)
        ahead = step_m @ np.array((math.cos(heading_rad), math.sin(heading_rad))) > 0.0
        room_m = left_m + self._same_way_m(ahead)
        speed = stoppable_speed(room_m, self._limits.v_accel_m_s2, self._limits.latency_s)
        v_m_s = math.copysign(min(self._options.v_m_s, max(SLOWEST_M_S, speed)), 1.0 if ahead else -1.0)
        bend = abs(v_m_s) * turn_rad / length_m
        w_rad_s = bend - HEADING_GAIN * abs(v_m_s) * error_rad - SIDE_GAIN * v_m_s * side_m
        limit = self._limits.w_max_rad_s
        return Twist2(v_m_s=v_m_s, w_rad_s=min(max(w_rad_s, -limit), limit))

    def _same_way_m(self, ahead: bool) -> float:
        """Way after the next pose that goes on in the same direction without a stop [m]."""
        total_m = 0.0
        for here, there in zip(self._poses[self._index + 1 :], self._poses[self._index + 2 :], strict=False):
            step_m = there[:2] - here[:2]
            along_m = float(step_m @ np.array((math.cos(here[2]), math.sin(here[2]))))
            if abs(along_m) < 1e-6 or (along_m > 0.0) != ahead:
                break
            total_m += math.hypot(*step_m)
        return total_m
