"""Handles the requests of clients and answers their queries, in the robot's loop."""

import time
from collections.abc import Callable, Generator, Mapping
from typing import Any

from thumper.board.board import Board
from thumper.common.errors import ThumperError
from thumper.navigation.goal import Goal
from thumper.ros import services
from thumper.ros.services import Service
from thumper.ros.to_ros import ERROR, INFO, WARN
from thumper.runtime.drive.drive_manager import DriveManager, DriveMode
from thumper.runtime.drive.waypoints import Missions, Waypoints
from thumper.runtime.publisher import Publisher
from thumper.runtime.requests import (
    COMMANDS,
    EmergencyStop,
    GoTo,
    Heartbeat,
    LogMessage,
    Query,
    Request,
    RobotCommand,
    SetPose,
    SimulatorCommand,
    Velocity,
    parse_goal,
)
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.service import board_parameters, slam_mode
from thumper.runtime.service.board_jobs import BoardJob, BoardJobQueue
from thumper.runtime.service.experiments import Experiments
from thumper.runtime.service.request_queue import RequestQueue
from thumper.runtime.service.simulator_control import Simulator, SimulatorControl
from thumper.runtime.service.stall_guard import STALE_REQUEST, StallGuard, starts_motion
from thumper.slam.mapper import Relocalizable

Handler = Callable[[], str]
"""Carries out a command and returns a description; raises ThumperError with the fix."""


Answer = Callable[[Query], dict[str, Any] | BoardJob]
"""Answers a query: returns the JSON object, or the job that finds it; raises ThumperError."""


class RequestHandler:
    """Dispatches requests to the parts of the robot that carry them out."""

    def __init__(
        self,
        *,
        request_queue: RequestQueue,
        drive_manager: DriveManager,
        inputs: SensorInputs,
        publisher: Publisher,
        check_goal: Callable[[Goal], None],
        simulator: Simulator | None,
    ) -> None:
        self.missions = Missions()
        self.handlers: dict[str, Handler] = {}  # commands of other packages
        self.accepts_goals = True
        self.simulation = SimulatorControl(simulator)
        self.experiments = Experiments(drive_manager.heartbeats)
        self.board_jobs = BoardJobQueue()
        self._request_queue = request_queue
        self._stall_guard = StallGuard()
        self._drive_manager = drive_manager
        self._inputs = inputs
        self._publisher = publisher
        self._check_goal = check_goal
        self._services = self._answers()
        self._drive_commands: dict[str, Handler] = {
            "cancel": self._cancel,
            "estop": self._emergency_stop,
            "clear_fault": self._clear_fault,
            "arm": self._arm,
            "disarm": self._disarm,
        }

    def process_pending(self) -> None:
        """Handle all queued requests. Never raises: a failed request is answered with its error."""
        stale = self._stall_guard.is_stale(time.monotonic())
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

    def refuse(self, reason: str) -> bool:
        """Refuse all queued requests: none must be carried out long after it was sent.

        Return whether an emergency stop was among them, which must not be lost.
        """
        self._stall_guard.is_stale(time.monotonic())  # refusing is not stalling
        self.board_jobs.refuse(reason)
        requests = [request for _, request in self._request_queue.take_all()]
        for request in requests:
            if isinstance(request, Query):
                request.reply({"ok": False, "error": reason})
        return any(isinstance(request, EmergencyStop) for request in requests)

    def advance_mission(self) -> None:
        """After the end of a drive, start the next leg of the mission, or end the mission."""
        outcome = self._drive_manager.outcome
        if outcome is None or not self.accepts_goals:
            return
        self._drive_manager.outcome = None
        goal = self.missions.next_goal() if outcome.reached else None
        mission = self.missions.newest
        if goal is not None and mission is not None:
            try:
                self._check_goal(goal)
                self._drive_manager.start(goal, self._inputs.telemetry, source=mission.source)
                return
            except ThumperError as error:
                self._finish(str(error), reached=False)
                return
        self._finish(outcome.reason, reached=outcome.reached)

    def _finish(self, reason: str, *, reached: bool) -> None:
        mission = self.missions.end(reason, reached=reached)
        if mission is not None:
            text = f"mission {mission.number} {mission.state.value}: {mission.reason}"
            self._publisher.publish_event(text, INFO if reached else WARN)

    def _handle(self, received_s: float, request: Request) -> None:
        match request:
            case Velocity():
                self._drive_manager.add_manual_command(received_s, request)
            case Heartbeat():
                self._drive_manager.heartbeats.record(request.source, received_s)
            case EmergencyStop():
                self.experiments.stop("emergency stop")
                self._drive_manager.emergency_stop()
            case GoTo():
                self._start_mission(request.goals, request.source)
            case RobotCommand():
                self._run_command(request.name)
            case SetPose():
                self._set_pose(request)
            case SimulatorCommand():
                self._publisher.publish_event(self.simulation.apply(request.content))
            case LogMessage():
                self._publisher.publish_event(request.text, INFO if request.good else WARN)
            case Query():
                self._answer(request)

    def _answer(self, ask: Query) -> None:
        try:
            answer_service = self._services.get(ask.name)
            if answer_service is None:
                raise ThumperError(f"no such service: {ask.name}")
            reply = answer_service(ask)
            if isinstance(reply, Generator):
                self.board_jobs.add(ask, reply)
                return
            answer = {"ok": True, **reply}
        except ThumperError as error:
            answer = {"ok": False, "error": str(error), "option": error.option}
        except Exception as error:
            answer = {"ok": False, "error": f"internal error: {type(error).__name__}: {error}"}
        ask.reply(answer)

    def _answers(self) -> dict[str, Answer]:
        """Return the function that answers each service."""
        answers: dict[Service[Any, Any], Answer] = {
            services.PARAMETERS_SCHEMA: lambda _: board_parameters.schema(),
            services.PARAMETERS_GET: lambda _: board_parameters.values(self._drive_manager.board),
            services.PARAMETERS_SET: self._set_parameters,
            services.PARAMETERS_SAVE: self._save_parameters,
            services.PARAMETERS_REVERT: self._revert_parameters,
            services.MISSION_SEND: self._send_mission,
            services.MISSION_STATE: lambda query: self._mission_state(query.content),
            services.MAPPING_STATE: lambda _: slam_mode.describe(self._inputs.estimator),
            services.COMMAND: lambda query: {"text": self._run_command(query.content.get("command"))},
            services.SIMULATOR_WORLD: lambda _: self.simulation.describe(),
            services.SIMULATOR_COMMAND: lambda query: {"text": self.simulation.apply(query.content)},
            services.EXPERIMENT_START: self._start_experiment,
            services.EXPERIMENT_STATE: lambda _: self.experiments.state(),
            services.EXPERIMENT_REPORT: lambda _: self.experiments.report(),
        }
        return {service.name: answer for service, answer in answers.items()}

    def _set_parameters(self, query: Query) -> BoardJob:
        self._require_no_experiment()
        return self._change(self._drive_manager.board, query.content)

    def _save_parameters(self, _query: Query) -> dict[str, Any]:
        self._require_no_experiment()
        self._require_stationary("save the parameters")
        answer = board_parameters.save(self._drive_manager.board)
        self._publisher.publish_event("parameters saved on the board")
        return answer

    def _revert_parameters(self, _query: Query) -> BoardJob:
        self._require_no_experiment()
        return board_parameters.revert(self._drive_manager.board)

    def _send_mission(self, query: Query) -> dict[str, Any]:
        return {"mission": self._start_mission((parse_goal(query.content),), query.source)}

    def _start_experiment(self, query: Query) -> dict[str, Any]:
        return {"text": self._request_experiment(query.content, query.source)}

    def _change(self, board: Board, content: Mapping[str, Any]) -> BoardJob:
        answer = yield from board_parameters.change(board, content)
        self._publisher.publish_event(f"parameters set: {answer['values']}")
        return answer

    def _start_mission(self, goals: tuple[Goal, ...], source: str) -> int:
        """Start a mission and return its number; raise ThumperError if that is impossible."""
        if not self.accepts_goals:
            raise ThumperError("this run has its own goals; `thumper run` without a goal accepts others")
        self._require_no_experiment()
        if not self._inputs.has_map:
            raise ThumperError("no goals are accepted yet: there is no map to plan with; is the lidar on?")
        self._check_goal(goals[0])
        self._drive_manager.start(goals[0], self._inputs.telemetry, source=source)
        return self.missions.start(Waypoints(goals=goals), source).number

    def _mission_state(self, content: Mapping[str, Any]) -> dict[str, Any]:
        number = content.get("mission")
        mission = self.missions.find(number) if isinstance(number, int) else self.missions.newest
        if mission is None:
            raise ThumperError("unknown mission; only the last ones are remembered")
        state, goal = self._inputs.estimator.state(), mission.legs[mission.leg].goal
        return {
            "mission": mission.number,
            "state": mission.state.value,
            "reason": mission.reason or self._drive_manager.reason,
            "leg": mission.leg,
            "legs": len(mission.legs),
            "distance_m": goal.distance_m(state.map_from_base) if state else None,
        }

    def _run_command(self, name: object) -> str:
        """Carry out one of `COMMANDS` and return a description."""
        if not isinstance(name, str) or name not in COMMANDS:
            raise ThumperError(f"unknown command {name!r}; choose from: {', '.join(COMMANDS)}")
        if name in ("cancel", "disarm") and self.experiments.stop("stopped on request"):
            return "the experiment stops"
        if name in slam_mode.MODES:
            return self._change_mode(name)
        if command := self._drive_commands.get(name):
            return command()
        handler = self.handlers.get(name)
        if handler is None:
            raise ThumperError(f"this run does not support {name.replace('_', ' ')}")
        text = handler()
        self._publisher.publish_event(text)
        return text

    def _cancel(self) -> str:
        mode = self._drive_manager.mode
        self._drive_manager.stop("cancelled")
        return "the robot was not moving" if mode is DriveMode.IDLE else "cancelled; the robot stops"

    def _emergency_stop(self) -> str:
        self._drive_manager.emergency_stop()
        return "emergency stop: the motors are off until the fault is cleared"

    def _clear_fault(self) -> str:
        self._drive_manager.clear_fault()
        return "fault cleared; the motors are off"

    def _arm(self) -> str:
        self._require_no_experiment()
        self._drive_manager.arm(self._inputs.telemetry)
        return "armed; the wheels hold still"

    def _disarm(self) -> str:
        self._drive_manager.disarm("disarmed")
        return "the motors are off"

    def _change_mode(self, name: str) -> str:
        self._require_no_experiment()
        self._require_stationary(name.replace("_", " "))
        text = slam_mode.change(self._inputs.estimator.mapper, name)
        self._publisher.publish_event(text)
        return text

    def _set_pose(self, request: SetPose) -> None:
        self._require_no_experiment()
        self._require_stationary("set its pose")
        mapper = self._inputs.estimator.mapper
        if not isinstance(mapper, Relocalizable):
            raise ThumperError("this mapping method cannot change the pose; pass it to `thumper run --start`")
        mapper.set_pose(request.map_from_base)
        self._publisher.publish_event("pose set")

    def _request_experiment(self, content: Mapping[str, Any], source: str) -> str:
        if not self.accepts_goals:
            raise ThumperError("this run has its own goals; `thumper run` without a goal accepts experiments")
        if self._drive_manager.mode is not DriveMode.IDLE:
            raise ThumperError("an experiment starts with the motors off: stop and disarm the robot first")
        return self.experiments.request(content, source)

    def _require_no_experiment(self) -> None:
        if self.experiments.running:
            raise ThumperError(f"{self.experiments.running} is running: cancel it first")

    def _require_stationary(self, action: str) -> None:
        if self._drive_manager.mode in (DriveMode.DRIVING, DriveMode.MANUAL, DriveMode.STOPPING):
            raise ThumperError(f"the robot must be stationary to {action}: stop it first")
