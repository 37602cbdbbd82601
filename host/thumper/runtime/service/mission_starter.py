"""Starts the missions that clients send, and reports their state."""

from collections.abc import Callable
from functools import partial

from thumper.common.errors import ThumperError
from thumper.ros.services import MissionStatus
from thumper.ros.to_ros import INFO, WARN
from thumper.runtime.drive.drive_manager import DriveManager
from thumper.runtime.drive.task_driver import TaskDriver
from thumper.runtime.drive.tasks import Task, follow_waypoints
from thumper.runtime.drive.waypoints import Missions, WaypointMission, Waypoints
from thumper.runtime.publisher import Publisher
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.service.preconditions import Preconditions
from thumper.runtime.service.recorded_wait import recorded_wait


class MissionStarter:
    """A mission is a task of the robot's loop that remembers its progress."""

    def __init__(
        self,
        *,
        task_driver: TaskDriver,
        drive_manager: DriveManager,
        inputs: SensorInputs,
        publisher: Publisher,
        preconditions: Preconditions,
        commands: Callable[[str], str],
    ) -> None:
        """`commands` carries out a command."""
        self.missions = Missions()
        self._task_driver = task_driver
        self._drive_manager = drive_manager
        self._inputs = inputs
        self._publisher = publisher
        self._preconditions = preconditions
        self._commands = commands

    def start(self, waypoints: Waypoints) -> int:
        """Start a mission and return its number; raise ThumperError if that is impossible."""
        self._preconditions.require_serving("others")
        self._preconditions.require_no_experiment()
        if not self._inputs.has_map:
            raise ThumperError("no goals are accepted yet: there is no map to plan with; is the lidar on?")
        self._task_driver.begin_at_once(self._follow(waypoints, self.missions.next_number))
        self._publisher.mission_reports_end = waypoints.has_one_leg  # the mission before has ended
        return self.missions.start(waypoints).number

    def state(self, number: int | None) -> MissionStatus:
        """Return the state of a mission, by default the newest; raise ThumperError if it is unknown."""
        mission = self.missions.newest if number is None else self.missions.find(number)
        if mission is None:
            raise ThumperError("unknown mission; only the last ones are remembered")
        state, goal = self._inputs.estimator.state(), mission.legs[mission.leg].goal
        return MissionStatus(
            mission=mission.number,
            state=mission.state.value,
            reason=mission.reason or self._drive_manager.remark,
            leg=mission.leg,
            legs=len(mission.legs),
            distance_m=goal.distance_m(state.map_from_base) if state else None,
        )

    def _follow(self, waypoints: Waypoints, number: int) -> Task:
        try:
            result = yield from follow_waypoints(
                waypoints,
                on_leg=lambda leg: self.missions.set_leg(number, leg),
                on_beep=lambda name: self._publisher.publish_event(f"beep at {name}"),
                recording=partial(recorded_wait, self._publisher, self._commands),
            )
        except GeneratorExit:  # replaced, or refused before it began
            self._end(number, "replaced by another goal")
            raise
        mission = self._end(number, result.reason, reached=result.reached)
        if mission is not None:
            ending = f"{'ended' if result.interrupted else 'not reached'}: {mission.reason}"
            if result.reached:
                ending = f"reached after {result.time_s:.1f} s"
            text = f"{mission.title} {ending}"
            self._publisher.publish_event(text, INFO if result.reached or result.interrupted else WARN)
        return result

    def _end(self, number: int, reason: str, *, reached: bool = False) -> WaypointMission | None:
        mission = self.missions.end(number, reason, reached=reached)
        if mission is not None:
            self._publisher.mission_reports_end = False
        return mission
