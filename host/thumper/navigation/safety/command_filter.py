"""The command filter: give way, dynamic obstacles, velocity smoother, collision monitor, escape."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.kinematics import DriveGeometry
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.costmap.local_model import NO_OBSTACLES, LocalModel
from thumper.navigation.footprint import Footprint
from thumper.navigation.safety.collision_monitor import CollisionMonitor, CollisionMonitorOptions
from thumper.navigation.safety.dynamic_obstacles import (
    DynamicObstacleOptions,
    DynamicObstacles,
    MovingObject,
)
from thumper.navigation.safety.escape import Escape
from thumper.navigation.safety.give_way import GiveWay
from thumper.navigation.safety.patience import Patience
from thumper.navigation.safety.tracks import STEPS, Tracks
from thumper.navigation.safety.velocity_smoother import smooth_velocity
from thumper.navigation.speed_limits import SpeedLimits, WheelRamp
from thumper.navigation.state import CycleInput

NOBODY: FloatArray = np.empty((STEPS, 0, 3))
# After so long of giving way in total the robot has priority for so long: it waits only for who comes into
# its path next. While nobody is in conflict, the total falls as slowly as it does with priority.
GIVING_WAY_S, PRIORITY_S = 6.0, 60.0
# After so long of waiting, something that moves but has no track, such as a curtain, is an obstacle like any
# other for so long.
WAITING_S, UNHEEDED_S = 6.0, 6.0
WALKING_MARGIN_M = 0.06  # more room for points on who walks: a foot is put down further on
FOOT_M = 0.10  # a foot of who walks out of view is somewhere within this distance of where it should be
AT_ONCE_M = 0.7  # nearer than this a step may end before the robot: it brakes as hard as it can
BEHIND_M = 0.3  # to give way backward, the robot must see so far


@dataclass(frozen=True, slots=True, kw_only=True)
class FilteredCommand:
    """The command that may be driven, and what the filter changed."""

    command: Twist2 | None  # None: rejected
    reason: str = ""  # why it was rejected or changed
    yielding: bool = False  # to let a dynamic obstacle pass: another motion, or zero
    escaping: bool = False  # another motion, because the wanted one was rejected
    slowing: Twist2 = field(default_factory=Twist2)  # instead of a rejected command


class CommandFilter:
    """Checks each command. `footprint` is the robot's own, `padded` the one of planning."""

    def __init__(
        self,
        *,
        limits: SpeedLimits,
        monitor: CollisionMonitorOptions,
        dynamic_obstacles: DynamicObstacleOptions,
        footprint: Footprint,
        padded: Footprint,
        drive: DriveGeometry | None,
        view: FieldOfView,
    ) -> None:
        ramp = WheelRamp.from_drive(limits, drive)
        self._limits = limits
        self._monitor = CollisionMonitor(monitor, limits, footprint, ramp)
        self._escape = Escape(self._monitor, limits, footprint)
        self._obstacles = NO_OBSTACLES
        self._dynamic_obstacles = DynamicObstacles(dynamic_obstacles, limits, padded, view)
        self._gives_way = dynamic_obstacles.ahead_s > 0.0
        self._view = view
        self._tracks = Tracks(dynamic_obstacles.least_m_s)
        self._give_way = GiveWay(limits, padded, margin_m=dynamic_obstacles.margin_m)
        self._costmap: Costmap | None = None
        self._map_from_local = Pose2()
        self._giving_way = Patience(GIVING_WAY_S, PRIORITY_S)
        self._waiting = Patience(WAITING_S, UNHEEDED_S)
        self._sees_behind = bool(_are_in_view(padded.polygon_m() - (BEHIND_M, 0.0), view).all())

    def update(self, cycle: CycleInput, model: LocalModel) -> None:
        """Take the cycle's obstacles, and detect the dynamic ones."""
        new_from_old = model.map_from_local @ self._map_from_local.inverse()
        self._map_from_local = model.map_from_local
        self._dynamic_obstacles.move(new_from_old)
        self._tracks.move(new_from_old)
        self._dynamic_obstacles.update(cycle.time_s, cycle.scan_pose, model.hits_m)
        lidar = cycle.scan_pose @ self._view.base_from_laser
        found = self._dynamic_obstacles
        self._tracks.update(cycle.time_s, lidar, found.small, found.moving)
        self._costmap = model.costmap
        obstacles = model.obstacles
        if self._gives_way:
            more_m = WALKING_MARGIN_M * self._tracks.are_near(obstacles.points_m)
            obstacles = obstacles._replace(position_error_m=obstacles.position_error_m + more_m)
            obstacles = obstacles.with_more(self._feet_out_of_view_m(cycle.map_from_base), FOOT_M)
        self._obstacles = obstacles.in_base(cycle.map_from_base)

    def _feet_out_of_view_m(self, map_from_base: Pose2) -> FloatArray:
        """Return where the lidar does not see who walks put down a foot, shape (n, 2) in map."""
        feet_m = self._tracks.feet_m()
        return feet_m[~_are_in_view(map_from_base.inverse().apply(feet_m), self._view)]

    def are_walking(self, points_m: FloatArray) -> NDArray[np.bool_]:
        """Return which points, shape (n, 2) in map, are on people who walk; none if the robot gives no way.

        What rests near who walks is an obstacle like any other.
        """
        if not self._gives_way or self._giving_way.is_over:
            return np.zeros(len(points_m), np.bool_)
        walk = self._tracks.are_near(points_m)
        walk[walk] = ~self._dynamic_obstacles.rested(points_m[walk])
        return walk

    def sees_motion(self, time_s: float) -> bool:
        """Return whether there are dynamic obstacles, or were a moment ago."""
        return self._dynamic_obstacles.have_moved_lately(time_s)

    def filter(
        self,
        wanted: ControlResult,
        request: ControlRequest,
        *,
        allow_escape: bool,
    ) -> FilteredCommand:
        """Return the command that may be driven.

        With `allow_escape` another motion may replace a rejected one.
        """
        command, reason = wanted.command, wanted.reason
        points_m = self._obstacles.points_m
        gives_way = allow_escape and self._gives_way and not self._giving_way.is_over
        discs = self._predicted() if gives_way else NOBODY
        is_conflict = gives_way and self._give_way.is_in_conflict(command or Twist2(), request, discs)
        self._giving_way.count(request.period_s, waits=is_conflict)
        if is_conflict:
            return self._give_way_command(request, discs)
        if command is not None:
            stop = self._waiting_reason(command, request, self._heeded(gives_way=gives_way))
            self._waiting.count(request.period_s, waits=stop is not None)
            if stop is not None:
                return FilteredCommand(command=self._waiting_command(request), reason=stop, yielding=True)
            command, stop = self._monitored(command, request, points_m)
            if stop is None:
                return FilteredCommand(command=command)
            reason = stop
        escape = self._escape_command(request) if allow_escape else None
        if escape is not None:
            return FilteredCommand(command=escape, reason=f"escaping: {reason}", escaping=True)
        return FilteredCommand(command=None, slowing=self._slowing(request), reason=reason)

    def _slowing(self, request: ControlRequest) -> Twist2:
        """Return the last command, slowed down as in a normal drive; zero if that would touch something.

        The board brakes harder. That tilts the base, and the lidar with it, so far ahead it sees the floor.
        """
        command, stop = self._monitored(Twist2(), request, NO_OBSTACLES.points_m)
        return command if stop is None else Twist2()

    def _waiting_command(self, request: ControlRequest) -> Twist2:
        """Return zero if something moves near the robot, else the last command, slowed down."""
        base = request.map_from_base
        near = any(
            np.hypot(*(moved.points_m - (base.x_m, base.y_m)).T).min() < AT_ONCE_M
            for moved in self._dynamic_obstacles.moving
        )
        return Twist2() if near else self._slowing(request)

    def _waiting_reason(
        self, command: Twist2, request: ControlRequest, moving: list[MovingObject]
    ) -> str | None:
        """Return why the robot must wait for one of these objects, or None."""
        return self._dynamic_obstacles.stop_reason(command, request.twist, request.map_from_base, moving)

    def _monitored(
        self, wanted: Twist2, request: ControlRequest, slowing_m: FloatArray
    ) -> tuple[Twist2, str | None]:
        """Return the command, smoothed, and slowed before these points, and why it must not be driven."""
        last, period_s = request.last_command, request.period_s
        command = smooth_velocity(wanted, last, self._limits, period_s)
        slowed = self._monitor.slow_down(command, slowing_m)
        command = smooth_velocity(slowed, last, self._limits, period_s)
        points_m, error_m, seen = self._obstacles
        return command, self._monitor.stop_reason(
            command, request.twist, points_m, error_m, period_s, seen=seen
        )

    def _heeded(self, *, gives_way: bool) -> list[MovingObject]:
        """Return what the robot waits for: with `gives_way` only what has no track, else all that moves.

        A foot rests while the other swings: so the tracks count beside the feet.
        """
        untracked = self._tracks.untracked
        if gives_way:
            return [] if self._waiting.is_over else untracked
        moving = [*self._dynamic_obstacles.moving, *self._tracks.outlines()]
        if not self._waiting.is_over:
            return moving
        return [one for one in moving if all(one is not other for other in untracked)]

    def _predicted(self) -> FloatArray:
        """Return the predicted discs of all that moves, as `Tracks.predicted`."""
        if self._costmap is None:
            return NOBODY
        return self._tracks.predicted(self._costmap)

    def _give_way_command(self, request: ControlRequest, discs: FloatArray) -> FilteredCommand:
        """Return the motion that lets somebody pass, as far as the monitor allows it.

        Only what does not walk slows it down: the plans know where people will be. They do not know that of
        somebody who has just come into view nearby: the robot stops. Somebody may come from where the lidar
        does not see: the robot does not back off into it.
        """
        points_m = self._obstacles.points_m
        still_m = points_m[~self.are_walking(request.map_from_base.apply(points_m))]

        def allowed(wanted: Twist2) -> Twist2 | None:
            if wanted.v_m_s < 0.0 and not self._sees_behind:
                return None
            if self._waiting_reason(wanted, request, self._heeded(gives_way=True)):
                return None
            command, stop = self._monitored(wanted, request, still_m)
            return command if stop is None else None

        base_m = np.array((request.map_from_base.x_m, request.map_from_base.y_m))
        unknown = self._tracks.has_unknown_near(base_m)
        command = Twist2() if unknown else self._give_way.best_command(request, discs, allowed)
        waits = command == Twist2()
        if waits:
            command = self._waiting_command(request)
        what = "waiting for" if waits else "giving way to"
        return FilteredCommand(command=command, reason=f"{what} something that moves", yielding=True)

    def _escape_command(self, request: ControlRequest) -> Twist2 | None:
        """Return a motion that gains room, if there is one; never toward a dynamic obstacle."""
        command = self._escape.compute_command(
            request, self._obstacles.points_m, self._obstacles.position_error_m
        )
        if command is None:
            return None
        stop = self._waiting_reason(command, request, self._dynamic_obstacles.moving)
        return command if stop is None else None


def _are_in_view(points_m: FloatArray, view: FieldOfView) -> NDArray[np.bool_]:
    """Return which places, shape (n, 2) in base_link, the lidar sees if nothing hides them, shape (n,)."""
    bearings_rad, ranges_m = view.bearings_and_ranges(Pose2(), points_m)
    return view.contains(bearings_rad, ranges_m, edge_rad=0.0)
