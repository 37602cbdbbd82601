"""The command filter: dynamic obstacles, velocity smoother, collision monitor, escape."""

from dataclasses import dataclass

from thumper.common.geometry import Twist2
from thumper.common.kinematics import DriveGeometry
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.costmap.local_model import NO_OBSTACLES, LocalModel
from thumper.navigation.footprint import Footprint
from thumper.navigation.safety.collision_monitor import CollisionMonitor, CollisionMonitorOptions
from thumper.navigation.safety.dynamic_obstacles import DynamicObstacleOptions, DynamicObstacles
from thumper.navigation.safety.escape import Escape
from thumper.navigation.safety.velocity_smoother import smooth_velocity
from thumper.navigation.speed_limits import SpeedLimits, WheelRamp
from thumper.navigation.state import CycleInput


@dataclass(frozen=True, slots=True, kw_only=True)
class FilteredCommand:
    """The command that may be driven, and what the filter changed."""

    command: Twist2 | None  # None: rejected
    reason: str = ""  # why it was rejected or changed
    yielding: bool = False  # zero, to let a dynamic obstacle pass
    escaping: bool = False  # another motion, because the wanted one was rejected


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

    def update(self, cycle: CycleInput, model: LocalModel) -> None:
        """Take the cycle's obstacles, and detect the dynamic ones."""
        if model.jumped:
            self._dynamic_obstacles.forget()
        self._dynamic_obstacles.update(cycle.time_s, cycle.scan_pose, model.hits_m)
        self._obstacles = model.obstacles.in_base(cycle.map_from_base)

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
        points_m, error_m, seen = self._obstacles
        if command is not None:
            if stop := self._dynamic_obstacles.stop_reason(command, request.twist, request.map_from_base):
                return FilteredCommand(command=Twist2(), reason=stop, yielding=True)
            command = smooth_velocity(command, request.last_command, self._limits, request.period_s)
            command = self._monitor.slow_down(command, points_m)
            stop = self._monitor.stop_reason(
                command, request.twist, points_m, error_m, request.period_s, seen=seen
            )
            if stop is None:
                return FilteredCommand(command=command)
            reason = stop
        escape = self._escape_command(request) if allow_escape else None
        if escape is not None:
            return FilteredCommand(command=escape, reason=f"escaping: {reason}", escaping=True)
        return FilteredCommand(command=None, reason=reason)

    def _escape_command(self, request: ControlRequest) -> Twist2 | None:
        """Return a motion that gains room, if there is one; never toward a dynamic obstacle."""
        command = self._escape.compute_command(
            request, self._obstacles.points_m, self._obstacles.position_error_m
        )
        if command is None:
            return None
        stop = self._dynamic_obstacles.stop_reason(command, request.twist, request.map_from_base)
        return command if stop is None else None
