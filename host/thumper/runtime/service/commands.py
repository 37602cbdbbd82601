"""Carries out the commands of `requests.COMMANDS`."""

from collections.abc import Callable, Mapping

from thumper.common.errors import ThumperError
from thumper.runtime.drive.drive_manager import DriveManager, DriveMode
from thumper.runtime.publisher import Publisher
from thumper.runtime.requests import COMMANDS
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.service import slam_mode
from thumper.runtime.service.preconditions import Preconditions

CommandHandler = Callable[[], str]
"""Carries out a command and returns a description; raises ThumperError with the fix."""


class Commands:
    """Each command returns a description of what it did."""

    def __init__(
        self,
        *,
        drive_manager: DriveManager,
        inputs: SensorInputs,
        publisher: Publisher,
        preconditions: Preconditions,
        starters: Mapping[str, CommandHandler],
        handlers: Mapping[str, CommandHandler],
    ) -> None:
        """`starters` start the task that a client requests; `handlers` are those of other packages."""
        self._starters = starters
        self.handlers = dict(handlers)
        self._drive_manager = drive_manager
        self._inputs = inputs
        self._publisher = publisher
        self._preconditions = preconditions
        self._drive_commands: dict[str, CommandHandler] = {
            "cancel": self._cancel,
            "estop": self._emergency_stop,
            "clear_fault": self._clear_fault,
            "clear_costmaps": self._clear_costmaps,
            "arm": self._arm,
            "disarm": self._disarm,
        }

    def run(self, name: str) -> str:
        """Carry out a command; raise ThumperError if it is impossible now."""
        if name not in COMMANDS:
            raise ThumperError(f"unknown command {name!r}; choose from: {', '.join(COMMANDS)}")
        stops = name in ("cancel", "disarm")
        if stops and self._preconditions.experiments.stop("stopped on request"):
            return "the experiment stops"
        if name in slam_mode.MODES:
            return self._change_mode(name)
        if command := self._drive_commands.get(name):
            return command()
        if starter := self._starters.get(name):
            return starter()
        handler = self.handlers.get(name)
        if handler is None:
            raise ThumperError(f"this run does not support {name.replace('_', ' ')}")
        text = handler()
        self._publisher.publish_event(text)
        return text

    def _cancel(self) -> str:
        mode, held_still = self._drive_manager.mode, self._drive_manager.holds_still
        self._drive_manager.stop("cancelled")
        if held_still:
            return "the robot was not moving; the motors go off"
        return "the robot was not moving" if mode is DriveMode.IDLE else "cancelled; the robot stops"

    def _emergency_stop(self) -> str:
        self._drive_manager.emergency_stop()
        return "emergency stop: the motors are off until the fault is cleared"

    def _clear_fault(self) -> str:
        self._drive_manager.clear_fault()
        return "fault cleared; the motors are off"

    def _clear_costmaps(self) -> str:
        state = self._inputs.estimator.state()
        if state is not None:
            self._drive_manager.navigator.clear_costmaps(state.map_from_base)
        return "the remembered obstacles are forgotten; those in map and scans stay"

    def _arm(self) -> str:
        self._preconditions.require_no_experiment()
        self._drive_manager.arm(self._inputs.telemetry)
        self._publisher.publish_event("armed", name="board")
        return "armed; the wheels hold still"

    def _disarm(self) -> str:
        self._drive_manager.disarm("disarmed")
        self._publisher.publish_event("disarmed", name="board")
        return "the motors are off"

    def _change_mode(self, name: str) -> str:
        self._preconditions.require_stationary(name.replace("_", " "))
        if name != "relocalize":  # it searches in slices
            self._preconditions.prepare_map_change(name.replace("_", " "))
        text = slam_mode.change(self._inputs.estimator.mapper, name)
        self._publisher.publish_event(text)
        return text
