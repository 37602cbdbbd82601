"""Docking: drive to the staging pose, approach by the tag, check, and try again if the robot is beside it.

The parts are those of Nav2's docking server: staging pose, approach by vision, check of the charger, retries.
"""

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace

from thumper.camera.dock_options import DockOptions
from thumper.camera.frame import CameraFrame
from thumper.camera.tag_tracker import TagTracker
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.maps.annotations import Annotations
from thumper.navigation.costmap.local_model import ObstaclePoints
from thumper.navigation.goal import Goal
from thumper.navigation.safety.collision_monitor import CollisionMonitor
from thumper.navigation.speed_limits import SpeedLimits
from thumper.runtime.drive.dock_approach import approach
from thumper.runtime.drive.legs import AnyLeg, Leg, Move, Wait
from thumper.runtime.drive.motions import Motion, MotionEnd, before_obstacles, drive_on_heading
from thumper.runtime.drive.tasks import Task
from thumper.runtime.drive_result import DriveResult
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.state_estimator import RobotState

FRAMES, LOOK_CYCLES = 8, 40  # to see before the approach and after it, and how long to wait for them
STAGING_TOLERANCE_M, STAGING_TOLERANCE_RAD = 0.05, 0.1
# As Nav2's dock_prestaging_tolerance: from here the approach needs no turns to and fro before it.
PRESTAGING_M, PRESTAGING_SIDE_M, PRESTAGING_RAD = 0.5, 0.15, 0.35
DOCKED_M, DOCKED_RAD = 0.008, 0.012
NOT_IN_VIEW = "the dock's tag is not in view"
NO_DOCK = "the tag is not in view, and the map has no place {place!r}: save it with the robot at the dock"
AT_DOCK_M = 0.3  # nearer than this the robot has no room to turn
CHARGER_S = 5.0
Step = Generator[AnyLeg, DriveResult, DriveResult]


@dataclass(slots=True, kw_only=True)
class Docking:
    """Makes the tasks that dock and undock.

    `newest_frames` returns the camera's frames of this cycle; None without a camera.
    """

    options: DockOptions
    inputs: SensorInputs
    tracker: TagTracker
    limits: SpeedLimits
    monitor: CollisionMonitor
    obstacles: Callable[[], ObstaclePoints]  # near the robot, in the map
    newest_frames: Callable[[], list[CameraFrame]] | None
    annotations: Callable[[], Annotations]
    _known: Pose2 | None = field(default=None, init=False)  # map_from_docked, by the tag

    @property
    def is_possible(self) -> bool:
        """Whether the robot has a camera."""
        return self.newest_frames is not None

    def dock(self) -> Task:
        """Dock, with retries; the reason of the result says how exactly, or why not."""
        self._known = None
        result = yield from self._look()
        if not result.reached:
            return result
        if self._docked() is None:
            return replace(result, reached=False, reason=NO_DOCK.format(place=self.options.place))
        for _ in range(1 + self.options.retries):
            result = yield from self._go_to_staging(result)
            if not result.reached:
                return result
            result = (yield from self._approach()).after(result)
            if result.reached or result.interrupted or not result.navigation_failed:
                return result
        tries = 1 + self.options.retries
        return replace(result, reason=f"{result.reason}; tried {tries} times")

    def undock(self) -> Task:
        """Drive back to the staging pose."""
        return (yield from self._back_off())

    def _go_to_staging(self, result: DriveResult) -> Step:
        if self._is_at_dock():
            result = (yield from self._back_off()).after(result)
            if not result.reached:
                return result
        if self._may_approach():
            return result
        docked = self._docked()
        assert docked is not None  # the tag was seen, or the place is known
        at = docked @ Pose2(x_m=-self.options.staging_m)
        goal = Goal(
            x_m=at.x_m,
            y_m=at.y_m,
            theta_rad=at.theta_rad,
            tolerance_m=STAGING_TOLERANCE_M,
            heading_tolerance_rad=STAGING_TOLERANCE_RAD,
        )
        return (yield Leg(goal=goal, name="to the dock")).after(result)

    def _is_at_dock(self) -> bool:
        """Return whether the robot is at the dock or just before it, and faces it."""
        docked = self._docked()
        if docked is None:
            return False
        at = docked.inverse() @ self._state().map_from_base
        return math.hypot(at.x_m, at.y_m) < AT_DOCK_M and abs(at.theta_rad) < PRESTAGING_RAD

    def _may_approach(self) -> bool:
        """Return whether the robot is so near to the staging pose that the approach ends at the dock."""
        at = self._docked_from_base() if self.tracker.count else None
        if at is None:
            return False
        from_staging = Pose2(x_m=at.x_m + self.options.staging_m, y_m=at.y_m, theta_rad=at.theta_rad)
        return (
            -PRESTAGING_M < from_staging.x_m < STAGING_TOLERANCE_M
            and abs(from_staging.y_m) < PRESTAGING_SIDE_M
            and abs(from_staging.theta_rad) < PRESTAGING_RAD
        )

    def _approach(self) -> Step:
        """Approach once. A result with `navigation_failed` is worth another try."""
        result = yield from self._look()
        if not result.reached:  # cancelled, or the robot failed
            return replace(result, navigation_failed=False)
        if not self.tracker.count:
            return replace(result, reached=False, navigation_failed=True, reason=NOT_IN_VIEW)
        before_V = self._battery_V()
        watched, ended = _watched(self._motion())
        result = (yield Move(motion=watched, name="docking")).after(result)
        if not result.reached:
            return replace(result, navigation_failed=bool(ended) and not result.interrupted)
        return (yield from self._check(before_V)).after(result)

    def _check(self, before_V: float) -> Step:
        """Look where the robot has stopped, and whether the charger is on."""
        result = yield from self._look()
        if not result.reached:
            return replace(result, navigation_failed=False)
        at = self._docked_from_base()
        if at is None:
            return replace(result, reached=False, reason=NOT_IN_VIEW)
        errors = f"{1e3 * at.x_m:+.0f} mm along, {1e3 * at.y_m:+.0f} mm beside"
        errors += f", {math.degrees(at.theta_rad):+.1f} degrees"
        if math.hypot(at.x_m, at.y_m) > DOCKED_M or abs(at.theta_rad) > DOCKED_RAD:
            return replace(result, reached=False, navigation_failed=True, reason=f"beside the dock: {errors}")
        if self.options.charger_V:
            charged = self._charger_is_on(before_V)
            waited = yield Wait(duration_s=CHARGER_S, until=charged, name="checking the charger")
            result = waited.after(result)
            if result.reached and not charged():
                reason = f"no charger at the contacts; {errors}"
                return replace(result, reached=False, navigation_failed=True, reason=reason)
        return replace(result, reason=f"docked: {errors}") if result.reached else result

    def _back_off(self) -> Step:
        # At the speed of the approach: a lidar may not see what is behind. That the ground there is unseen,
        # for a robot that was switched on at the dock, must not keep it there; elsewhere it must.
        crosses_unseen = self._docked() is None or self._is_at_dock()

        def obstacles(_state: RobotState) -> ObstaclePoints:
            return self.obstacles().without_unseen() if crosses_unseen else self.obstacles()

        limits = replace(self.limits, v_max_m_s=min(self.limits.v_max_m_s, self.options.speed_m_s))
        motion = drive_on_heading(-self.options.staging_m, limits, self._state().map_from_base)
        motion = before_obstacles(motion, self.monitor, obstacles)
        return (yield Move(motion=motion, name="undocking"))

    def _look(self) -> Step:
        """Wait until enough frames have shown the tag, or for a while."""
        self.tracker.forget()

        def has_seen() -> bool:
            self._add_frames()
            return self.tracker.count >= FRAMES

        return (yield Wait(duration_s=math.inf, until=has_seen, max_cycles=LOOK_CYCLES, name="looking"))

    def _motion(self) -> Motion:
        motion = approach(
            self._docked_from_base,
            lambda: self._state().time_s - self.tracker.newest_s,
            speed_m_s=self.options.speed_m_s,
            limits=self.limits,
        )

        def by_newest_frames(state: RobotState) -> object:
            self._add_frames()
            return motion(state)

        return before_obstacles(by_newest_frames, self.monitor)  # type: ignore[arg-type]

    def _add_frames(self) -> None:
        assert self.newest_frames is not None  # callers ask `is_possible`
        estimator = self.inputs.estimator
        for frame in self.newest_frames()[-1:]:
            odom_from_base = estimator.odom_from_base_at(frame.time_s)
            if odom_from_base is not None:
                self.tracker.add(frame, odom_from_base)

    def _docked(self) -> Pose2 | None:
        """Return map_from_docked by the saved place, else by the tag, as it is now or was last seen."""
        if (saved := self._saved_place()) is not None:
            return saved
        if (tag := self.tracker.odom_from_tag) is not None:
            self._known = self.inputs.estimator.map_from_odom @ tag @ self.options.tag_from_docked
        return self._known

    def _saved_place(self) -> Pose2 | None:
        for place in self.annotations().places:
            if place.name.casefold() == self.options.place.casefold():
                if place.yaw_rad is None:
                    raise ThumperError(f"the place {place.name!r} has no heading; save it with one")
                return Pose2(x_m=place.x_m, y_m=place.y_m, theta_rad=place.yaw_rad)
        return None

    def _docked_from_base(self) -> Pose2 | None:
        tag, odometry = self.tracker.odom_from_tag, self.inputs.estimator.odometry
        if tag is None or odometry is None:
            return None
        return (tag @ self.options.tag_from_docked).inverse() @ odometry.odom_from_base

    def _state(self) -> RobotState:
        state = self.inputs.estimator.state()
        assert state is not None  # a leg has started
        return state

    def _battery_V(self) -> float:
        telemetry = self.inputs.telemetry
        return math.nan if telemetry is None else telemetry.battery_mV / 1000.0

    def _charger_is_on(self, before_V: float) -> Callable[[], bool]:
        return lambda: self._battery_V() >= before_V + self.options.charger_V


def _watched(motion: Motion) -> tuple[Motion, list[MotionEnd]]:
    """Return the motion, and a list that receives how it ended itself; empty if something else ended it."""
    ended: list[MotionEnd] = []

    def next_command(state: RobotState) -> object:
        command = motion(state)
        if isinstance(command, MotionEnd):
            ended.append(command)
        return command

    return next_command, ended  # type: ignore[return-value]
