"""Starts the docking and undocking that a client requests."""

from collections.abc import Callable

from thumper.common.errors import ThumperError
from thumper.ros.to_ros import INFO, WARN
from thumper.runtime.drive.docking import Docking
from thumper.runtime.drive.drive_manager import DriveManager
from thumper.runtime.drive.task_driver import TaskDriver
from thumper.runtime.drive.tasks import Task
from thumper.runtime.publisher import Publisher
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.service.preconditions import Preconditions

DONE = {"dock": "docked", "undock": "undocked"}


class DockStarter:
    """Docks, and switches the motors off at the dock. An event says how it ended."""

    def __init__(
        self,
        *,
        docking: Docking,
        task_driver: TaskDriver,
        drive_manager: DriveManager,
        inputs: SensorInputs,
        publisher: Publisher,
        preconditions: Preconditions,
    ) -> None:
        self.is_busy = False  # docks or undocks
        self._docking = docking
        self._task_driver = task_driver
        self._drive_manager = drive_manager
        self._inputs = inputs
        self._publisher = publisher
        self._preconditions = preconditions

    @property
    def is_possible(self) -> bool:
        """Whether the robot has what it needs to dock."""
        return self._docking.is_possible

    def dock(self) -> str:
        """Start to dock; raise ThumperError if that is impossible now."""
        return self._start("dock", lambda docking: docking.dock())

    def undock(self) -> str:
        """Start to undock; raise ThumperError if that is impossible now."""
        return self._start("undock", lambda docking: docking.undock())

    def _start(self, name: str, task_of: Callable[[Docking], Task]) -> str:
        self._preconditions.require_serving("docking")
        self._preconditions.require_no_experiment()
        if not self.is_possible:
            raise ThumperError("docking needs a camera: set [camera] enabled = true")
        if not self._inputs.has_map:
            raise ThumperError(f"cannot {name} yet: there is no map to plan with; is the lidar on?")
        self._task_driver.begin_at_once(self._reported(name, task_of(self._docking)))
        return f"{name}ing"

    def _reported(self, name: str, task: Task) -> Task:
        done, self.is_busy = DONE[name], True
        try:
            result = yield from task
        except GeneratorExit:  # another task drives on
            self._publisher.publish_event(f"not {done}: replaced by another task", WARN)
            raise
        except ThumperError as refusal:
            self._end(f"not {done}: {refusal}", WARN)
            raise
        except Exception as error:  # the motors must not stay on
            self._end(f"not {done}: internal error: {type(error).__name__}: {error}", WARN)
            raise
        finally:
            self.is_busy = False
        text = result.reason if result.reason.startswith(done) else f"{done}: {result.reason}"
        if not result.reached:
            text = f"not {done}: {result.reason}"
        self._end(text, INFO if result.reached else WARN)
        return result

    def _end(self, text: str, level: int) -> None:
        self._drive_manager.stop(text)  # a motion leaves the motors on
        self._publisher.publish_event(text, level)
