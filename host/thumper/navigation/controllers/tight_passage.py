"""Drive through a tight passage: plan poses for the whole footprint and follow them slowly.

In a corridor hardly wider than the robot, a controller that scores the twists of the next second sees only
that all of them are bad: the way out may begin with a step back.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.common.resumable import Search, SlicedSearch, merged
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.controllers.rotate_in_place import (
    SLOWEST_TURN_RAD_S,
    poses_are_free,
    straight_poses,
    turn_poses,
)
from thumper.navigation.controllers.stopping_check import braking_distance_s, simulated_poses
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.planners.goal_poses import GoalPoses
from thumper.navigation.planners.lattice import LatticePlanner
from thumper.navigation.planners.polyline import arc_lengths
from thumper.navigation.speed_limits import SpeedLimits, step_toward, stoppable_speed

SIDE_GAIN, HEADING_GAIN = 20.0, 9.0  # [1/m^2], [1/m]: critically damped over about a quarter of a metre
AT_POSE_M, AT_POSE_RAD = 0.01, 0.06
FASTEST_TURN_RAD_S = 0.8
ROOMY_M_S, ROOMY_AHEAD_M = 0.25, 0.15  # where that far ahead has room for the outline, if not to turn
ROOM_M = 0.03  # beyond the circumscribed circle: enough for any controller
SAME_PLACE_M = 1e-6
SLOWEST_M_S = 0.05
STEP_S = 0.05
NEAR_M = 0.3  # the robot backs straight to a pose nearer than this
SPARE_M = 0.02  # more room than usual beside a straight way that the search did not choose
MOST_ERROR_RAD = 0.15  # beside obstacles the robot turns on the spot if its heading is further off
BEND_RAD = 0.02  # a step that turns by less is straight
GOAL_POSE_SETS = 2  # sets of headings at the goal that are checked in one cycle
MAX_OFFSET_M = 0.08  # a robot further from its poses gives them up


@dataclass(frozen=True, slots=True, kw_only=True)
class TightPassageOptions:
    """How the robot drives through tight passages."""

    # Speed along the poses [m/s].
    v_m_s: Annotated[float, Gt(0)] = 0.12
    # Distance driven pose by pose before the controller is tried again [m]; 0 turns this off.
    length_m: Annotated[float, Ge(0)] = 0.8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseStep:
    """The move from one pose of the sequence to the next."""

    start: FloatArray  # x, y, theta
    step_m: FloatArray  # shape (2,)
    turn_rad: float
    length_m: float

    @classmethod
    def between(cls, start: FloatArray, end: FloatArray) -> "PoseStep":
        """Return the move between two poses."""
        step_m = end[:2] - start[:2]
        return cls(
            start=start, step_m=step_m, turn_rad=float(end[2] - start[2]), length_m=math.hypot(*step_m)
        )


class PoseSequenceFollower:
    """Follows one sequence: `plan`, `advance` until it has a result, `compute_command` until it is None."""

    def __init__(
        self, options: TightPassageOptions, limits: SpeedLimits, footprint: Footprint, lattice: LatticePlanner
    ) -> None:
        self._options = options
        self._limits = limits
        self._footprint = footprint
        self._lattice = lattice
        self._poses: FloatArray = np.empty((0, 3))
        self._index = 0
        self._passage_only = self._was_tight = self._whole = False
        self._fastest_m_s, self._fastest_rad_s = options.v_m_s, FASTEST_TURN_RAD_S
        self._search = SlicedSearch[FloatArray]()
        self.active = False
        self.reaches_goal = False  # the poses lead to the goal, not only toward it

    def plan(self, request: ControlRequest, goal: Goal, *, passage_only: bool) -> None:
        """Begin to plan poses to a goal; the robot must be stationary until `advance` returns the result.

        With `passage_only` the sequence ends as soon as the tight passage is behind the robot.
        """
        self.active, self._passage_only, self._whole = False, passage_only, False
        if self._options.length_m == 0.0:
            self._search.start(_no_poses())
        else:
            costmap = request.pose_costmap or request.costmap
            self._search.start(
                self._lattice.search_poses(costmap, request.map_from_base, goal, known_ground=True)
            )

    def plan_to(self, request: ControlRequest, costmap: Costmap, ends: Search[GoalPoses]) -> None:
        """Begin to plan poses that lead exactly to one of the ends; see `LatticePlanner.search_poses_to`.

        `costmap` is the one in which the ends are searched, in cells as fine as the request's or finer.
        """
        self.active, self._passage_only, self._whole = False, False, True
        self._search.start(self._direct_poses(request, costmap, merged(ends, GOAL_POSE_SETS)))

    def _direct_poses(
        self, request: ControlRequest, fine: Costmap, ends: Search[GoalPoses]
    ) -> Search[FloatArray]:
        """Return poses to one of the ends: straight as far as that is free, then as planned."""
        costmap = request.pose_costmap or request.costmap
        found = yield from ends
        if len(found.poses) == 0:
            return found.poses
        yield
        base = request.map_from_base
        poses: FloatArray = yield from self._lattice.search_poses_to(costmap, fine, base, *found)
        if len(poses) == 0:
            return poses
        direct: FloatArray = np.array(((*poses[0, :2], base.theta_rad), poses[0]))  # a turn on the spot
        roomy = self._footprint.grown(SPARE_M)
        index = 0
        for last in range(len(poses) - 1, -1, -1):
            way = straight_way(base, poses[last])
            if poses_are_free(costmap, roomy, swept(way), base, unknown_blocks=False):
                direct, index = way, last
                break
        result: FloatArray = np.vstack((direct, poses[index + 1 :]))
        result[:, 2] = np.unwrap(result[:, 2])
        return result

    def advance(self) -> bool | None:
        """Plan on; return whether there are poses to follow, or None while the planning goes on.

        There are none if no poses lead to the goal or the robot is already there.
        """
        poses = self._search.advance()
        if poses is None:
            return None
        if len(poses) < 2:
            return False
        count = int(np.searchsorted(arc_lengths(poses), self._options.length_m)) + 1
        self._poses = poses[: max(2, count)] if not self._whole else poses
        self.reaches_goal = len(self._poses) == len(poses)
        self._index = 0
        self._was_tight = False
        self.active = True
        return True

    @property
    def last_pose(self) -> FloatArray:
        """The end of the sequence: x, y, theta."""
        pose: FloatArray = self._poses[-1]
        return pose

    @property
    def is_planning(self) -> bool:
        """Whether the planning goes on."""
        return self._search.is_running

    def stop(self) -> None:
        """Drop the sequence."""
        self.active = False
        self._search.stop()

    def compute_command(self, request: ControlRequest) -> ControlResult | None:
        """Return the next twist.

        None once the passage or the last pose has been passed, or the robot has left the poses.
        """
        tight = not self._has_room(request)
        passed = self._passage_only and self._was_tight and not tight
        self._was_tight |= tight
        self._fastest_m_s, self._fastest_rad_s = self._options.v_m_s, FASTEST_TURN_RAD_S
        if self._whole and not tight:
            self._fastest_m_s = max(self._fastest_m_s, request.v_limit_m_s)
            self._fastest_rad_s = self._limits.w_max_rad_s
        elif self._whole and self._is_roomy(request):
            self._fastest_m_s = max(self._fastest_m_s, min(ROOMY_M_S, request.v_limit_m_s))
        wanted = None if passed else self._wanted(request)
        if wanted is None:
            self.active = False
            return None
        limits, period_s, last = self._limits, request.period_s, request.last_command
        command = Twist2(
            v_m_s=step_toward(last.v_m_s, wanted.v_m_s, limits.v_accel_m_s2 * period_s),
            w_rad_s=step_toward(last.w_rad_s, wanted.w_rad_s, limits.w_accel_rad_s2 * period_s),
        )
        driven_s = limits.latency_s + period_s + braking_distance_s(command, limits)
        poses = simulated_poses(request, command, limits, step_s=STEP_S, count=math.ceil(driven_s / STEP_S))
        start, costmap = request.map_from_base, request.costmap
        if self._whole and request.fine_costmap:
            costmap = request.fine_costmap()  # as it was planned; the collision monitor checks unseen ground
        if not poses_are_free(costmap, self._footprint, poses, start, unknown_blocks=False):
            return ControlResult(command=None, reason="the path through the tight passage is not free")
        return ControlResult(command=command, trajectory=self._poses)

    def _has_room(self, request: ControlRequest) -> bool:
        """Return whether the robot could rotate in place here, with some room to spare."""
        base, costmap = request.map_from_base, request.costmap
        rows, cols = costmap.cells_of(np.array(((base.x_m, base.y_m),)))
        room_m = math.sqrt(float(costmap.squared_cells[rows[0], cols[0]])) * costmap.resolution_m
        return room_m >= self._footprint.circumscribed_radius_m + ROOM_M

    def _is_roomy(self, request: ControlRequest) -> bool:
        """Return whether the robot can drive straight on, or back, with room to spare on both sides."""
        base = request.map_from_base
        poses = straight_poses(base, math.copysign(ROOMY_AHEAD_M, request.last_command.v_m_s))
        return poses_are_free(
            request.costmap, self._footprint.grown(ROOM_M), poses, base, unknown_blocks=False
        )

    def _wanted(self, request: ControlRequest) -> Twist2 | None:
        """Return the twist toward the next pose that is not yet reached; None if there is none."""
        base = request.map_from_base
        while self._index < len(self._poses) - 1:
            segment = PoseStep.between(self._poses[self._index], self._poses[self._index + 1])
            if segment.length_m < SAME_PLACE_M:
                target_rad = float(self._poses[self._index + 1, 2])
                further_rad = self._same_turn_rad(segment.turn_rad)
                wanted = self._turn(base.theta_rad, target_rad, segment.turn_rad, further_rad)
            else:
                offset_m = np.array((base.x_m, base.y_m)) - segment.start[:2]
                along_m = float(offset_m @ segment.step_m) / segment.length_m
                nearest_m = segment.start[:2] + segment.step_m * along_m / segment.length_m
                if math.dist((base.x_m, base.y_m), nearest_m) > MAX_OFFSET_M:
                    return None
                wanted = self._drive(base.theta_rad, offset_m, along_m, segment)
            if wanted is not None:
                return wanted
            self._index += 1
        return None

    def _turn(
        self, theta_rad: float, target_rad: float, turn_rad: float, further_rad: float = 0.0
    ) -> Twist2 | None:
        """Return the twist of a rotation in place; None at its end. `further_rad`: it goes on afterwards."""
        left_rad = wrap_angle(target_rad - theta_rad) * math.copysign(1.0, turn_rad)
        if left_rad < AT_POSE_RAD:
            return None
        left_rad += further_rad
        speed = stoppable_speed(left_rad, self._limits.w_accel_rad_s2, self._limits.latency_s)
        speed = min(speed, self._fastest_rad_s, self._limits.w_max_rad_s)
        return Twist2(w_rad_s=math.copysign(max(SLOWEST_TURN_RAD_S, speed), turn_rad))

    def _same_turn_rad(self, turn_rad: float) -> float:
        """Return the rotation after the next pose that continues in the same direction [rad]."""
        total_rad = 0.0
        for here, there in zip(self._poses[self._index + 1 :], self._poses[self._index + 2 :], strict=False):
            further_rad = float(there[2] - here[2])
            if math.dist(here[:2], there[:2]) > SAME_PLACE_M or further_rad * turn_rad <= 0.0:
                break
            total_rad += abs(further_rad)
        return total_rad

    def _drive(
        self, theta_rad: float, offset_m: FloatArray, along_m: float, segment: PoseStep
    ) -> Twist2 | None:
        """Return the twist along a segment; None at its end. `offset_m` is the robot's, from its start."""
        left_m = segment.length_m - along_m
        if left_m < AT_POSE_M:
            return None
        fraction = min(1.0, max(0.0, along_m / segment.length_m))
        heading_rad = float(segment.start[2]) + fraction * segment.turn_rad
        error_m = offset_m - fraction * segment.step_m
        side_m = -math.sin(heading_rad) * error_m[0] + math.cos(heading_rad) * error_m[1]
        error_rad = wrap_angle(theta_rad - heading_rad)
        if self._whole and abs(error_rad) > MOST_ERROR_RAD:
            return self._turn(theta_rad, heading_rad, -error_rad)
        forward = segment.step_m @ np.array((math.cos(heading_rad), math.sin(heading_rad))) > 0.0
        room_m, bend_m = self._ahead_m(segment, left_m, forward)
        speed = stoppable_speed(room_m, self._limits.v_accel_m_s2, self._limits.latency_s)
        # To brake to the speed in the bend takes the distance to a stop, less the one from there to a stop.
        in_bend_m_s, accel, latency_s = self._options.v_m_s, self._limits.v_accel_m_s2, self._limits.latency_s
        bend_m += in_bend_m_s * latency_s + 0.5 * in_bend_m_s * in_bend_m_s / accel
        fastest_m_s = min(self._fastest_m_s, stoppable_speed(bend_m, accel, latency_s))
        v_m_s = math.copysign(min(fastest_m_s, max(SLOWEST_M_S, speed)), 1.0 if forward else -1.0)
        feed_forward = abs(v_m_s) * segment.turn_rad / segment.length_m
        w_rad_s = feed_forward - HEADING_GAIN * abs(v_m_s) * error_rad - SIDE_GAIN * v_m_s * side_m
        limit = self._limits.w_max_rad_s
        return Twist2(v_m_s=v_m_s, w_rad_s=min(max(w_rad_s, -limit), limit))

    def _ahead_m(self, segment: PoseStep, left_m: float, forward: bool) -> tuple[float, float]:
        """Return how far the poses go on in the same direction, and how far to the next bend [m]."""
        total_m, bend_m = left_m, 0.0 if abs(segment.turn_rad) > BEND_RAD else math.inf
        for here, there in zip(self._poses[self._index + 1 :], self._poses[self._index + 2 :], strict=False):
            step_m = there[:2] - here[:2]
            along_m = float(step_m @ np.array((math.cos(here[2]), math.sin(here[2]))))
            if abs(along_m) < 1e-6 or (along_m > 0.0) != forward:
                break
            if abs(there[2] - here[2]) > BEND_RAD:
                bend_m = min(bend_m, total_m)
            total_m += math.hypot(*step_m)
        return total_m, bend_m


def straight_way(start: Pose2, end: FloatArray) -> FloatArray:
    """Return the poses of a turn, a straight drive forward and a turn to a pose, shape (4, 3).

    The drive is backward if the end lies behind and is near.
    """
    bearing_rad = math.atan2(end[1] - start.y_m, end[0] - start.x_m)
    distance_m = math.dist((start.x_m, start.y_m), end[:2])
    if distance_m < NEAR_M and abs(wrap_angle(bearing_rad - start.theta_rad)) > 0.5 * math.pi:
        bearing_rad += math.pi
    first_rad = start.theta_rad + wrap_angle(bearing_rad - start.theta_rad)
    last_rad = first_rad + wrap_angle(end[2] - first_rad)
    return np.array(
        (
            (start.x_m, start.y_m, start.theta_rad),
            (start.x_m, start.y_m, first_rad),
            (end[0], end[1], first_rad),
            (end[0], end[1], last_rad),
        )
    )


def swept(way: FloatArray) -> FloatArray:
    """Return the poses along a `straight_way`, close to each other, shape (m, 3)."""
    start, turned, there, end = (Pose2(x_m=x, y_m=y, theta_rad=theta) for x, y, theta in way.tolist())
    return np.vstack(
        (
            turn_poses(start, turned.theta_rad - start.theta_rad),
            straight_poses(turned, (turned.inverse() @ there).x_m),
            turn_poses(there, end.theta_rad - there.theta_rad),
        )
    )


def _no_poses() -> Search[FloatArray]:
    yield from ()
    return np.empty((0, 3))
