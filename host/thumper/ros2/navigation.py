"""Nav2's actions NavigateToPose, FollowWaypoints and ComputePathToPose for the robot."""

import json
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from thumper.bus.client import BusClient
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.common.stamps import NS_PER_S
from thumper.common.texts import choice_hint
from thumper.config.robot import RobotConfig
from thumper.maps.annotations import annotations_of
from thumper.navigation.costmap.filters import CostmapFilters, load_masks
from thumper.navigation.costmap.zones import zone_masks
from thumper.navigation.goal import Goal, check_place
from thumper.ros import services
from thumper.ros.codec import Message, message
from thumper.ros.from_ros import grid_of, pose_of, stamp_ns_of
from thumper.ros.services import FindMission, MissionStarted, MissionStatus, RunCommand, SendMission
from thumper.ros.to_json import from_json
from thumper.ros.to_ros import Messages
from thumper.ros2.actions import ABORTED, CANCELED, SUCCEEDED, Feedback, RosAction, RosGoal
from thumper.ros2.interfaces import COMPUTE_PATH_TO_POSE, FOLLOW_WAYPOINTS, MISSED_WAYPOINT, NAVIGATE_TO_POSE
from thumper.ros2.node import RosNode
from thumper.runtime.requests import MAX_WAYPOINTS

PERIOD_S = 0.2  # of feedback
LOST_S = 5.0  # a goal ends if the robot does not answer for so long

# Error codes of nav2_msgs. NavigateToPose has none of its own in Jazzy; this is UNKNOWN of later releases.
NAVIGATION_FAILED, WAYPOINT_FAILED = 9000, 600
PLAN_FAILED, INVALID_PLANNER, TF_ERROR, NO_VALID_PATH = 200, 201, 202, 208


@dataclass(frozen=True, slots=True, kw_only=True)
class _Outcome:
    status: int
    reason: str = ""
    leg: int = 0

    def error(self, code: int) -> tuple[int, str]:
        """Return error code and message of the result."""
        return (0, "") if self.status == SUCCEEDED else (code, self.reason)


class NavigationActions:
    """Serves the three actions of one robot. Its newest goal replaces the one before, which is aborted."""

    def __init__(
        self, bus: BusClient, node: RosNode, config: RobotConfig, newest_map: Callable[[], Message | None]
    ) -> None:
        self._bus, self._config, self._newest_map = bus, config, newest_map
        self._pose: Message | None = None
        self._zones = CostmapFilters()
        bus.subscribe("pose", self._on_pose)
        bus.subscribe("annotations", self._on_annotations)
        RosAction(node, "navigate_to_pose", NAVIGATE_TO_POSE, self._navigate)
        RosAction(node, "follow_waypoints", FOLLOW_WAYPOINTS, self._follow)
        RosAction(node, "compute_path_to_pose", COMPUTE_PATH_TO_POSE, self._plan)

    def _on_pose(self, pose: Message) -> None:
        self._pose = pose

    def _on_annotations(self, geojson: Message) -> None:
        with suppress(ValueError, ThumperError):  # of another version
            self._zones = zone_masks(annotations_of(json.loads(geojson.data)).zones)

    def _navigate(self, goal: RosGoal, feedback: Feedback) -> tuple[int, Message]:
        begin_ns = time.time_ns()

        def start() -> MissionStarted:
            pose = _in_map(goal.content.pose)
            request = SendMission(x_m=pose.x_m, y_m=pose.y_m, yaw_rad=pose.theta_rad)
            return services.MISSION_SEND.call(self._bus, request)

        def report(state: MissionStatus) -> None:
            content = from_json(
                f"{NAVIGATE_TO_POSE}_Feedback",
                {
                    "navigation_time": _duration(time.time_ns() - begin_ns),
                    "distance_remaining": state.distance_m or 0.0,
                },
            )
            if self._pose is not None:
                content.current_pose.header = self._pose.header
                content.current_pose.pose = self._pose.pose.pose
            feedback(content)

        outcome = self._drive(goal, start, report)
        code, text = outcome.error(NAVIGATION_FAILED)
        return outcome.status, message(f"{NAVIGATE_TO_POSE}_Result", error_code=code, error_msg=text)

    def _follow(self, goal: RosGoal, feedback: Feedback) -> tuple[int, Message]:
        poses = goal.content.poses
        first = min(goal.content.goal_index, len(poses))
        loops = min(goal.content.number_of_loops, MAX_WAYPOINTS)  # the robot refuses more goals
        drives = [*range(first, len(poses)), *list(range(len(poses))) * loops]

        def start() -> MissionStarted:
            targets = [_in_map(poses[index]) for index in drives]
            goals = [{"x_m": at.x_m, "y_m": at.y_m, "yaw_rad": at.theta_rad} for at in targets]
            return services.MISSION_FOLLOW.call(self._bus, {"goals": goals})

        def report(state: MissionStatus) -> None:
            feedback(message(f"{FOLLOW_WAYPOINTS}_Feedback", current_waypoint=drives[state.leg]))

        outcome = self._drive(goal, start, report)
        code, text = outcome.error(WAYPOINT_FAILED)
        missed = []
        if outcome.status == ABORTED and drives:
            index = drives[outcome.leg]
            missed = [message(MISSED_WAYPOINT, index=index, goal=poses[index], error_code=code)]
        return outcome.status, message(
            f"{FOLLOW_WAYPOINTS}_Result", missed_waypoints=missed, error_code=code, error_msg=text
        )

    def _drive(
        self, goal: RosGoal, start: Callable[[], MissionStarted], report: Callable[[MissionStatus], None]
    ) -> _Outcome:
        """Start a mission and follow it to its end."""
        try:
            number = start().mission
        except (ThumperError, ValueError) as error:
            return _Outcome(status=ABORTED, reason=str(error))
        is_cancelled, leg, answered_s = False, 0, time.monotonic()
        was_set = False
        while True:
            if was_set:
                time.sleep(PERIOD_S)  # `cancel.wait` does not wait once it is set
            else:
                was_set = goal.cancel.wait(PERIOD_S)
            try:
                state = services.MISSION_STATE.call(self._bus, FindMission(mission=number))
            except ThumperError as error:  # the robot restarts, or is gone
                if time.monotonic() - answered_s > LOST_S:
                    return _Outcome(status=ABORTED, reason=str(error), leg=leg)
                continue
            leg, answered_s = state.leg, time.monotonic()
            if state.state == "driving":
                report(state)
                if was_set and not is_cancelled:
                    with suppress(ThumperError):  # refused: the robot drives on, so the goal does; try again
                        services.COMMAND.call(self._bus, RunCommand(command="cancel"))
                        is_cancelled = True
            else:
                ended = CANCELED if is_cancelled else ABORTED
                status = SUCCEEDED if state.state == "reached" else ended
                return _Outcome(status=status, reason=state.reason, leg=leg)

    def _plan(self, goal: RosGoal, _feedback: Feedback) -> tuple[int, Message]:
        """Plan with the robot's planner in its newest map, in this process: the robot drives on."""
        begin_ns = time.time_ns()
        result = from_json(f"{COMPUTE_PATH_TO_POSE}_Result", {})
        try:
            path_m, code, text = self._path(goal.content)
            result.path = Messages(epoch_ns=stamp_ns_of(self._pose) if self._pose else 0).path(0.0, path_m)
        except (ThumperError, ValueError) as error:
            code, text = PLAN_FAILED, str(error)
        result.error_code, result.error_msg = code, text
        took = _duration(time.time_ns() - begin_ns)
        result.planning_time = from_json("builtin_interfaces/msg/Duration", took)
        if goal.cancel.is_set():
            return CANCELED, result
        return (ABORTED if code else SUCCEEDED), result

    def _path(self, request: Message) -> tuple[np.ndarray, int, str]:
        """Return the path, shape (n, 2), error code and message. Raises ThumperError or ValueError."""
        from thumper.navigation.costmap.costmap import build_costmap
        from thumper.navigation.registry import PLANNERS, make_planner

        none = np.empty((0, 2))
        options = self._config.navigation
        name = request.planner_id or options.planner
        newest, pose = self._newest_map(), self._pose
        if name not in PLANNERS:
            return none, INVALID_PLANNER, f"unknown planner {name!r}; {choice_hint(name, sorted(PLANNERS))}"
        if newest is None or (pose is None and not request.use_start):
            return none, TF_ERROR, "the robot has no map or no pose yet"
        start = _in_map(request.start) if request.use_start or pose is None else pose_of(pose.pose.pose)
        target = _in_map(request.goal)
        check_place("the start", start.x_m, start.y_m)
        check_place("the goal", target.x_m, target.y_m)
        keepout = (load_masks(options.masks) + self._zones).keepout
        costmap = build_costmap(grid_of(newest), none, self._config.footprint, options.costmap, keepout)
        planner = make_planner(replace(options, planner=name), self._config.footprint)
        found = planner.plan(costmap, start, Goal(x_m=target.x_m, y_m=target.y_m, theta_rad=target.theta_rad))
        if found.path_m is None:
            return none, NO_VALID_PATH, found.reason
        return found.path_m, 0, ""


def _in_map(stamped: Message) -> Pose2:
    """Convert a PoseStamped; raises ValueError for another frame or an invalid pose."""
    if stamped.header.frame_id not in ("map", ""):
        raise ValueError(f"frame {stamped.header.frame_id!r} is not supported; use the frame map")
    return pose_of(stamped.pose)


def _duration(duration_ns: int) -> dict[str, int]:
    sec, nanosec = divmod(duration_ns, NS_PER_S)
    return {"sec": sec, "nanosec": nanosec}
