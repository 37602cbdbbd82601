"""Takes what others ask of the robot, has it done by those who can, and answers. Runs in the robot's loop."""

import time
from collections.abc import Callable, Generator, Mapping
from typing import Any

from thumper.board.board import Board
from thumper.common.errors import ThumperError
from thumper.navigation.goal import Goal
from thumper.ros.to_ros import ERROR, INFO, WARN
from thumper.runtime.drive.drive_manager import DriveManager, DriveMode
from thumper.runtime.drive.waypoints import Missions
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
    goal_of,
)
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.service import board_parameters, slam_mode
from thumper.runtime.service.board_jobs import BoardJob, BoardJobQueue
from thumper.runtime.service.experiments import Experiments
from thumper.runtime.service.request_queue import RequestQueue
from thumper.runtime.service.simulator_control import Simulation, Simulator
from thumper.runtime.service.stall_guard import TOLD, StallGuard, sets_going

Handler = Callable[[], str]
"""Carries out a command and returns what it did, in words; raises ThumperError with the cure."""


class RequestHandler:
    """One per robot."""

    def __init__(
        self,
        *,
        inbox: RequestQueue,
        pilot: DriveManager,
        senses: SensorInputs,
        products: Publisher,
        check_goal: Callable[[Goal], None],
        simulator: Simulator | None,
    ) -> None:
        self.missions = Missions()
        self.handlers: dict[str, Handler] = {}  # of commands that others carry out
        self.takes_goals = True
        self.simulation = Simulation(simulator)
        self.experiments = Experiments()
        self.errands = BoardJobQueue()
        self._inbox = inbox
        self._waking = StallGuard()
        self._pilot = pilot
        self._senses = senses
        self._products = products
        self._check_goal = check_goal

    def attend(self) -> None:
        """Take and do everything that waits. Never raises: what cannot be done is told to who asked."""
        late = self._waking.is_late(time.monotonic())
        for came_s, request in self._inbox.take():
            try:
                if late and sets_going(request):
                    if isinstance(request, Query):
                        request.reply({"ok": False, "error": TOLD})
                    raise ThumperError(TOLD)
                self._do(came_s, request)
            except ThumperError as error:
                self._products.event(str(error), WARN)
            except Exception as error:  # a request must not end the robot's loop
                self._products.event(f"internal error: {type(error).__name__}: {error}", ERROR)

    def refuse(self, why: str) -> bool:
        """Do nothing of what waits, and say so: a request must not be carried out long after it was made.

        Returns whether an emergency stop was among it, which must not be lost.
        """
        self._waking.is_late(time.monotonic())  # it does not hang: it refuses
        self.errands.refuse(why)
        requests = [request for _, request in self._inbox.take()]
        for request in requests:
            if isinstance(request, Query):
                request.reply({"ok": False, "error": why})
        return any(isinstance(request, EmergencyStop) for request in requests)

    def follow_up(self) -> None:
        """Go on with the next leg of a mission, or note how it ended."""
        ending = self._pilot.ending
        if ending is None or not self.takes_goals:
            return
        self._pilot.ending = None
        goal = self.missions.next_goal() if ending.reached else None
        mission = self.missions.newest
        if goal is not None and mission is not None:
            try:
                self._check_goal(goal)
                self._pilot.start(goal, self._senses.telemetry, source=mission.source)
                return
            except ThumperError as error:
                self._finish(str(error), reached=False)
                return
        self._finish(ending.reason, reached=ending.reached)

    def _finish(self, reason: str, *, reached: bool) -> None:
        mission = self.missions.end(reason, reached=reached)
        if mission is not None:
            text = f"mission {mission.number} {mission.state.value}: {mission.reason}"
            self._products.event(text, INFO if reached else WARN)

    def _do(self, came_s: float, request: Request) -> None:
        match request:
            case Velocity():
                self._pilot.take(came_s, request)
            case Heartbeat():
                self._pilot.supervision.beat(request.source, came_s)
            case EmergencyStop():
                self.experiments.stop("emergency stop")
                self._pilot.emergency_stop()
            case GoTo():
                self._go(request.goals, request.source)
            case RobotCommand():
                self._order(request.name)
            case SetPose():
                self._relocate(request)
            case SimulatorCommand():
                self._products.event(self.simulation.apply(request.content))
            case LogMessage():
                self._products.event(request.text, INFO if request.good else WARN)
            case Query():
                self._answer(request)

    def _answer(self, ask: Query) -> None:
        try:
            reply = self._reply_to(ask)
            if isinstance(reply, Generator):
                self.errands.add(ask, reply)
                return
            answer = {"ok": True, **reply}
        except ThumperError as error:
            answer = {"ok": False, "error": str(error), "option": error.option}
        except Exception as error:
            answer = {"ok": False, "error": f"internal error: {type(error).__name__}: {error}"}
        ask.reply(answer)

    def _reply_to(self, ask: Query) -> dict[str, Any] | BoardJob:
        """The answer, or how to come by it."""
        board = self._pilot.board
        match ask.name:
            case "parameters/schema":
                return board_parameters.schema()
            case "parameters/get":
                return board_parameters.values(board)
            case "parameters/set":
                self._must_not_experiment()
                return self._change(board, ask.content)
            case "parameters/save":
                self._must_not_experiment()
                self._must_stand("save the parameters")
                answer = board_parameters.save(board)
                self._products.event("parameters saved on the board")
                return answer
            case "parameters/revert":
                self._must_not_experiment()
                return board_parameters.revert(board)
            case "mission/send":
                return {"mission": self._go((goal_of(ask.content),), ask.source)}
            case "mission/state":
                return self._mission_state(ask.content)
            case "mapping/state":
                return slam_mode.state(self._senses.perception)
            case "command":
                return {"text": self._order(ask.content.get("command"))}
            case "simulator/world":
                return self.simulation.describe()
            case "simulator/command":
                return {"text": self.simulation.apply(ask.content)}
            case "experiment/start":
                return {"text": self._begin_experiment(ask.content, ask.source)}
            case "experiment/state":
                return self.experiments.state()
            case "experiment/report":
                return self.experiments.report()
        raise ThumperError(f"no such question: {ask.name}")

    def _change(self, board: Board, content: Mapping[str, Any]) -> BoardJob:
        answer = yield from board_parameters.change(board, content)
        self._products.event(f"parameters set: {answer['values']}")
        return answer

    def _go(self, goals: tuple[Goal, ...], source: str) -> int:
        """Set out, or say why not; returns the mission's number."""
        if not self.takes_goals:
            raise ThumperError("this run has goals of its own; `thumper run` without one takes others")
        self._must_not_experiment()
        if not self._senses.has_looked:
            raise ThumperError("no goal is taken yet: nothing was seen to plan with; is the lidar on?")
        self._check_goal(goals[0])
        self._pilot.start(goals[0], self._senses.telemetry, source=source)
        return self.missions.begin(goals, source).number

    def _mission_state(self, content: Mapping[str, Any]) -> dict[str, Any]:
        number = content.get("mission")
        mission = self.missions.find(number) if isinstance(number, int) else self.missions.newest
        if mission is None:
            raise ThumperError("no such mission")
        situation, goal = self._senses.perception.situation(), mission.goals[mission.leg]
        return {
            "mission": mission.number,
            "state": mission.state.value,
            "reason": mission.reason or self._pilot.reason,
            "leg": mission.leg,
            "legs": len(mission.goals),
            "distance_m": goal.distance_m(situation.map_from_base) if situation else None,
        }

    def _order(self, name: object) -> str:
        """Carry out one of the known commands; returns what was done."""
        pilot = self._pilot
        if not isinstance(name, str) or name not in COMMANDS:
            raise ThumperError(f"no command {name!r}; there are {', '.join(COMMANDS)}")
        match name:
            case "cancel" | "disarm" if self.experiments.stop("stopped on request"):
                return "the experiment stops"
            case "cancel":
                was = pilot.mode
                pilot.stop("cancelled")
                return (
                    "the robot stood still already" if was is DriveMode.IDLE else "cancelled; the robot stops"
                )
            case "estop":
                pilot.emergency_stop()
                return "emergency stop: the motors are off until the fault is cleared"
            case "clear_fault":
                pilot.clear_fault()
                return "fault cleared; the motors are off"
            case "arm":
                self._must_not_experiment()
                pilot.arm(self._senses.telemetry)
                return "armed: the wheels are held"
            case "disarm":
                pilot.disarm("disarmed")
                return "the motors are off"
            case "localise" | "map_on" | "relocalise":
                return self._change_mode(name)
        handler = self.handlers.get(name)
        if handler is None:
            raise ThumperError(f"this robot's process cannot {name.replace('_', ' ')}")
        text = handler()
        self._products.event(text)
        return text

    def _change_mode(self, name: str) -> str:
        self._must_not_experiment()
        self._must_stand(f"{name.replace('_', ' ')}")
        text = slam_mode.change(self._senses.perception.mapper, name)
        self._products.event(text)
        return text

    def _relocate(self, request: SetPose) -> None:
        self._must_not_experiment()
        self._must_stand("be told where it is")
        set_pose = getattr(self._senses.perception.mapper, "set_pose", None)
        if set_pose is None:
            raise ThumperError(
                "this mapping method cannot be told where the robot is; give it to `thumper run --start`"
            )
        set_pose(request.map_from_base)
        self._products.event("the robot was told where it is")

    def _begin_experiment(self, content: Mapping[str, Any], source: str) -> str:
        if not self.takes_goals:
            raise ThumperError("this run has goals of its own; `thumper run` without one takes experiments")
        if self._pilot.mode is not DriveMode.IDLE:
            raise ThumperError("an experiment begins with the motors off: stop and disarm the robot first")
        return self.experiments.ask_for(content, source)

    def _must_not_experiment(self) -> None:
        if self.experiments.running:
            raise ThumperError(f"{self.experiments.running} is under way: cancel it first")

    def _must_stand(self, what: str) -> None:
        if self._pilot.mode in (DriveMode.DRIVING, DriveMode.MANUAL, DriveMode.STOPPING):
            raise ThumperError(f"the robot must stand to {what}: stop it first")
