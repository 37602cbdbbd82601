"""Handles the requests of clients and answers their queries, in the robot's loop."""

import time
from collections.abc import Callable, Generator, Mapping
from typing import Any, TypeVar

from thumper.common.errors import ThumperError
from thumper.ros import services
from thumper.ros.service import Service, json_object, request_content
from thumper.ros.services import (
    Empty,
    ExperimentReport,
    ExperimentState,
    MissionStarted,
    ParameterValues,
    RunCommand,
    SendMission,
    StartExperiment,
    Text,
)
from thumper.ros.to_ros import ERROR, INFO, WARN
from thumper.runtime.drive.docking import Docking
from thumper.runtime.drive.drive_manager import DriveManager
from thumper.runtime.drive.exploration import map_to_explore
from thumper.runtime.drive.task_driver import TaskDriver
from thumper.runtime.drive.waypoint_requests import parse_waypoints
from thumper.runtime.drive.waypoints import Missions, Waypoints
from thumper.runtime.publisher import Publisher
from thumper.runtime.requests import (
    EmergencyStop,
    GoTo,
    Heartbeat,
    LogMessage,
    OverrideAssistance,
    Query,
    Request,
    RobotCommand,
    SetPose,
    SimulatorCommand,
    Velocity,
    parse_goal,
)
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.service import board_parameters, slam_mode, wheels
from thumper.runtime.service.board_jobs import BoardJob, BoardJobQueue
from thumper.runtime.service.commands import CommandHandler, Commands
from thumper.runtime.service.dock_starter import DockStarter
from thumper.runtime.service.experiments import Experiments
from thumper.runtime.service.exploration_starter import ExplorationStarter
from thumper.runtime.service.library import MapLibrary, MapStorage
from thumper.runtime.service.low_battery import LowBattery
from thumper.runtime.service.mission_starter import MissionStarter
from thumper.runtime.service.object_goals import ObjectGoals
from thumper.runtime.service.preconditions import Preconditions
from thumper.runtime.service.request_queue import RequestQueue
from thumper.runtime.service.simulator_control import Simulator, SimulatorControl
from thumper.runtime.service.stall_guard import STALE_REQUEST, StallGuard, starts_motion
from thumper.slam.mapper import Relocalizable

RequestT = TypeVar("RequestT")
ReplyT = TypeVar("ReplyT")

Answer = Callable[[Query], object]
"""Answers a query: returns the reply, or the job that finds it; raises ThumperError."""


class RequestHandler:
    """Dispatches requests to the parts of the robot that carry them out."""

    def __init__(
        self,
        *,
        request_queue: RequestQueue,
        drive_manager: DriveManager,
        task_driver: TaskDriver,
        inputs: SensorInputs,
        publisher: Publisher,
        simulator: Simulator | None,
        storage: MapStorage,
        docking: Docking,
    ) -> None:
        self.simulation = SimulatorControl(simulator)
        self.experiments = Experiments()
        self.board_jobs = BoardJobQueue()
        self.annotations = storage.annotations
        self.docking = docking
        self._request_queue = request_queue
        self._stall_guard = StallGuard()
        self._drive_manager = drive_manager
        self._inputs = inputs
        self._publisher = publisher
        self._preconditions = Preconditions(drive_manager=drive_manager, experiments=self.experiments)
        self._missions = MissionStarter(
            task_driver=task_driver,
            drive_manager=drive_manager,
            inputs=inputs,
            publisher=publisher,
            preconditions=self._preconditions,
            commands=self._carry_out,
        )
        exploration = ExplorationStarter(
            footprint=storage.annotations.footprint,
            task_driver=task_driver,
            drive_manager=drive_manager,
            now=map_to_explore(inputs.estimator, drive_manager.navigator),
            inputs=inputs,
            publisher=publisher,
            preconditions=self._preconditions,
        )
        dock = DockStarter(
            docking=docking,
            task_driver=task_driver,
            drive_manager=drive_manager,
            inputs=inputs,
            publisher=publisher,
            preconditions=self._preconditions,
        )
        self._low_battery = LowBattery(
            options=docking.options,
            inputs=inputs,
            drive_manager=drive_manager,
            task_driver=task_driver,
            publisher=publisher,
            annotations=storage.annotations,
            missions=self._missions,
            docks=dock,
        )
        self._commands = Commands(
            drive_manager=drive_manager,
            inputs=inputs,
            publisher=publisher,
            preconditions=self._preconditions,
            starters={"explore": exploration.start, "dock": dock.dock, "undock": dock.undock},
            handlers={"save_map": storage.saver} if storage.saver else {},
        )
        self._object_goals = ObjectGoals(
            objects=storage.objects,
            estimator=inputs.estimator,
            navigator=drive_manager.navigator,
            footprint=storage.annotations.footprint,
        )
        self._library = MapLibrary(
            storage, estimator=inputs.estimator, publisher=publisher, preconditions=self._preconditions
        )
        self._answers = self._answers_by_name()

    @property
    def missions(self) -> Missions:
        """The missions of clients."""
        return self._missions.missions

    @property
    def handlers(self) -> dict[str, CommandHandler]:
        """The commands of other packages."""
        return self._commands.handlers

    @property
    def accepts_goals(self) -> bool:
        """Whether clients decide what the robot does."""
        return self._preconditions.accepts_goals

    @accepts_goals.setter
    def accepts_goals(self, accepts: bool) -> None:
        self._preconditions.accepts_goals = accepts

    def process_pending(self) -> None:
        """Handle all queued requests. Never raises: a failed request is answered with its error."""
        stale = self._stall_guard.is_stale(time.monotonic())
        if self._drive_manager.is_stop_unconfirmed:
            self._request_queue.put(EmergencyStop())  # until the board confirms it
        for received_s, request in self._request_queue.take_all():
            try:
                if stale and starts_motion(request):
                    if isinstance(request, Query):
                        request.reply({"ok": False, "error": STALE_REQUEST})
                    raise ThumperError(STALE_REQUEST)
                self._handle(received_s, request)
            except ThumperError as error:
                self._publisher.publish_event(str(error), WARN)
            except Exception as error:  # a request must not end the robot's loop
                self._publisher.publish_event(f"internal error: {type(error).__name__}: {error}", ERROR)
        if self.accepts_goals:
            self._low_battery.update()

    def refuse(self, reason: str) -> None:
        """Refuse all queued requests: none must be carried out long after it was sent.

        An emergency stop must not be lost: it is still to be confirmed when the board answers again.
        """
        self._stall_guard.is_stale(time.monotonic())  # refusing is not stalling
        self.board_jobs.refuse(reason)
        for _, request in self._request_queue.take_all():
            self._drive_manager.is_stop_unconfirmed |= _is_emergency_stop(request)
            if isinstance(request, Query):
                request.reply({"ok": False, "error": reason})

    def _handle(self, received_s: float, request: Request) -> None:
        match request:
            case Velocity():
                self._drive_manager.add_manual_command(received_s, request)
            case OverrideAssistance():
                self._drive_manager.override_assistance(received_s)
            case Heartbeat():
                self.experiments.heartbeats.record(request.source, received_s)
            case EmergencyStop():
                self.experiments.stop("emergency stop")
                self._drive_manager.emergency_stop()
            case GoTo():
                self._missions.start(Waypoints.at(*request.goals))
            case RobotCommand():
                self._commands.run(request.name)
            case SetPose():
                try:
                    self._set_pose(request)
                except ThumperError as error:  # a message has no answer: the sender reads the log
                    raise ThumperError(f"the pose was not set: {error}") from error
            case SimulatorCommand():
                self._change_simulation(request.content, "")
            case LogMessage():
                self._publisher.publish_event(request.text, INFO if request.good else WARN)
            case Query():
                self._answer(request)

    def _answer(self, ask: Query) -> None:
        try:
            answer = self._answers.get(ask.name)
            if answer is None:
                raise ThumperError(f"no such service: {ask.name}")
            reply = answer(ask)
            if isinstance(reply, Generator):
                self.board_jobs.add(ask, reply)
                return
            content = {"ok": True, **json_object(reply)}
        except ThumperError as error:
            content = {"ok": False, "error": str(error), "option": error.option}
        except Exception as error:
            content = {"ok": False, "error": f"internal error: {type(error).__name__}: {error}"}
        ask.reply(content)

    def _answers_by_name(self) -> dict[str, Answer]:
        """Return the function that answers each service."""
        board = self._drive_manager
        return dict(
            (
                _bind(services.PARAMETERS_SCHEMA, lambda _, __: board_parameters.schema()),
                _bind(services.PARAMETERS_GET, lambda _, __: board_parameters.values(board.board)),
                _bind(services.PARAMETERS_SET, self._set_parameters),
                _bind(services.PARAMETERS_SAVE, self._save_parameters),
                _bind(services.PARAMETERS_REVERT, self._revert_parameters),
                _bind(services.MISSION_SEND, self._send_mission),
                _bind(services.MISSION_FOLLOW, self._follow_mission),
                _bind(services.MISSION_STATE, lambda find, _: self._missions.state(find.mission)),
                _bind(services.MAPPING_STATE, lambda _, __: slam_mode.describe(self._inputs)),
                _bind(services.WHEELS_STATE, lambda _, __: wheels.describe(self._inputs.estimator)),
                _bind(services.ANNOTATION_ADD, self.annotations.add),
                _bind(services.ANNOTATION_REMOVE, self.annotations.remove),
                _bind(services.LIBRARY_LIST, self._library.content),
                _bind(services.LIBRARY_SAVE, self._library.save),
                _bind(services.LIBRARY_LOAD, self._library.load),
                _bind(services.LIBRARY_RENAME, self._library.rename),
                _bind(services.LIBRARY_DELETE, self._library.delete),
                _bind(services.COMMAND, self._run_command),
                _bind(services.SIMULATOR_WORLD, lambda _, __: self.simulation.describe()),
                _bind(services.SIMULATOR_COMMAND, self._change_simulation),
                _bind(services.EXPERIMENT_START, self._start_experiment),
                _bind(services.EXPERIMENT_STATE, self._experiment_state),
                _bind(services.EXPERIMENT_REPORT, self._experiment_report),
            )
        )

    def _set_parameters(self, content: Mapping[str, Any], _source: str) -> BoardJob[ParameterValues]:
        self._preconditions.require_no_experiment()
        return self._change(content)

    def _change(self, content: Mapping[str, Any]) -> BoardJob[ParameterValues]:
        reply = yield from board_parameters.change(self._drive_manager.board, content)
        wheels.take_parameters(self._inputs.estimator, reply.values)
        self._publisher.publish_event(f"parameters set: {board_parameters.described(reply.values)}")
        return reply

    def _save_parameters(self, _request: Empty, _source: str) -> BoardJob[Empty]:
        self._preconditions.require_stationary("save the parameters")
        return self._save()

    def _save(self) -> BoardJob[Empty]:
        reply = yield from board_parameters.save(self._drive_manager.board)
        self._publisher.publish_event("parameters saved on the board")
        return reply

    def _revert_parameters(self, _request: Empty, _source: str) -> BoardJob[ParameterValues]:
        self._preconditions.require_no_experiment()
        return self._revert()

    def _revert(self) -> BoardJob[ParameterValues]:
        reply = yield from board_parameters.revert(self._drive_manager.board)
        wheels.take_parameters(self._inputs.estimator, reply.values)
        return reply

    def _send_mission(self, request: SendMission, _source: str) -> MissionStarted:
        content = dict(request_content(request))
        if (label := content.pop("object", None)) is not None:
            content = self._object_goals.content(str(label), content)
        goal = parse_goal(content, self.annotations.value, self._inputs.estimator.map_datum())
        place = str(content.get("place", ""))
        return MissionStarted(mission=self._missions.start(Waypoints.at(goal, place=place)))

    def _follow_mission(self, content: Mapping[str, Any], _source: str) -> MissionStarted:
        datum = self._inputs.estimator.map_datum()
        waypoints = parse_waypoints(content, self.annotations.value, datum)
        return MissionStarted(mission=self._missions.start(waypoints))

    def _carry_out(self, command: str) -> str:
        return self._commands.run(command)

    def _run_command(self, request: RunCommand, _source: str) -> Text:
        return Text(text=self._carry_out(request.command))

    def _change_simulation(self, content: Mapping[str, Any], _source: str) -> Text:
        if "world" in content:
            self._preconditions.require_motors_off("another world")
        text = self.simulation.apply(content)
        self._publisher.publish_event(text)
        return Text(text=text)

    def _start_experiment(self, request: StartExperiment, source: str) -> Text:
        self._preconditions.require_serving("experiments")
        self._preconditions.require_motors_off("an experiment")
        if (state := self._inputs.estimator.state()) is not None:
            self._preconditions.require_free_lane(request.lane_m, state)
        return Text(text=self.experiments.request(request, source))

    def _experiment_state(self, _request: Empty, _source: str) -> ExperimentState:
        return self.experiments.state()

    def _experiment_report(self, _request: Empty, _source: str) -> ExperimentReport:
        return self.experiments.report()

    def _set_pose(self, request: SetPose) -> None:
        self._preconditions.require_stationary("set its pose")
        mapper = self._inputs.estimator.mapper
        if not isinstance(mapper, Relocalizable):
            raise ThumperError("this mapping method cannot change the pose; pass it to `thumper run --start`")
        mapper.set_pose(request.map_from_base)
        self._preconditions.drive_manager.forget_reason()
        self._publisher.publish_event("pose set")


def _bind(
    service: Service[RequestT, ReplyT], answer: Callable[[RequestT, str], ReplyT | BoardJob[ReplyT]]
) -> tuple[str, Answer]:
    """Return a service's name, and the function that parses a query and passes it with its source on."""
    return service.name, lambda query: answer(service.parse(query.content), query.source)


def _is_emergency_stop(request: Request) -> bool:
    match request:
        case EmergencyStop() | RobotCommand(name="estop"):
            return True
        case Query(name=services.COMMAND.name):
            return request.content.get("command") == "estop"
    return False
