"""What a wanted motion passes on its way to the wheels: who moves there, smooth speeds, what it may touch."""

from dataclasses import dataclass

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.kinematics import DriveGeometry
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.controllers.controller import ControlRequest, ControlResult
from thumper.navigation.footprint import Footprint
from thumper.navigation.safety.collision_monitor import CollisionMonitor, CollisionMonitorOptions
from thumper.navigation.safety.dynamic_obstacles import DynamicObstacleOptions, DynamicObstacles
from thumper.navigation.safety.escape import Escape
from thumper.navigation.safety.velocity_smoother import smooth_velocity
from thumper.navigation.speed_limits import SpeedLimits, WheelRamp


@dataclass(frozen=True, slots=True, kw_only=True)
class FilteredCommand:
    """What became of a wanted motion."""

    command: Twist2 | None  # None: it is refused
    reason: str = ""  # why it is refused, or why it is not the wanted one
    gives_way: bool = False  # it stands for somebody who passes
    frees_itself: bool = False  # another motion, for the wanted one is refused


class CommandFilter:
    """Has the last word on each command. `footprint` is the robot's own, `padded` that of planning."""

    def __init__(
        self,
        limits: SpeedLimits,
        monitor: CollisionMonitorOptions,
        traffic: DynamicObstacleOptions,
        footprint: Footprint,
        padded: Footprint,
        drive: DriveGeometry | None,
        view: FieldOfView,
    ) -> None:
        ramp = WheelRamp.of(limits, drive)
        self._limits = limits
        self._monitor = CollisionMonitor(monitor, limits, footprint, ramp)
        self._escape = Escape(self._monitor, limits, footprint)
        self._traffic = DynamicObstacles(traffic, limits, padded, view)

    def see(self, time_s: float, map_from_base: Pose2, hits_in_map_m: FloatArray) -> None:
        """Take a scan's hits, shape (n, 2) [m], in the order of their beams: what moves is found in them."""
        self._traffic.update(time_s, map_from_base, hits_in_map_m)

    def judge(
        self,
        wanted: ControlResult,
        request: ControlRequest,
        hits_in_base_m: FloatArray,
        spread_m: FloatArray,
        *,
        may_free: bool,
    ) -> FilteredCommand:
        """Return the motion that may be driven; hits as the monitor takes them.

        `may_free` allows another motion than the wanted one where that is refused.
        """
        command, reason = wanted.command, wanted.reason
        if command is not None:
            if why := self._traffic.objection(command, request.twist, request.map_from_base):
                return FilteredCommand(command=Twist2(), reason=why, gives_way=True)
            command = smooth_velocity(command, request.last_command, self._limits, request.period_s)
            command = self._monitor.slowed(command, hits_in_base_m)
            reason = self._monitor.objection(
                command, request.twist, hits_in_base_m, spread_m, request.period_s
            )
            if not reason:
                return FilteredCommand(command=command)
        freeing = self._freeing(request, hits_in_base_m, spread_m) if may_free else None
        if freeing is not None:
            return FilteredCommand(command=freeing, reason=f"freeing itself: {reason}", frees_itself=True)
        return FilteredCommand(command=None, reason=reason)

    def _freeing(
        self, request: ControlRequest, hits_in_base_m: FloatArray, spread_m: FloatArray
    ) -> Twist2 | None:
        """The way out of a refusal, if there is one: not before somebody who moves."""
        command = self._escape.command(request, hits_in_base_m, spread_m)
        if command is None or self._traffic.objection(command, request.twist, request.map_from_base):
            return None
        return command
