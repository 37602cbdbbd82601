"""What must hold before a request is carried out. Each check raises ThumperError with the fix."""

from dataclasses import dataclass

from thumper.common.errors import ThumperError
from thumper.runtime.drive.drive_manager import DriveManager, DriveMode
from thumper.runtime.service.experiments import Experiments


@dataclass(slots=True, kw_only=True)
class Preconditions:
    """The checks that several requests share."""

    drive_manager: DriveManager
    experiments: Experiments
    accepts_goals: bool = True  # no: the program drives to goals of its own

    def require_serving(self, what: str) -> None:
        """Refuse `what`, in the plural, while the program drives to goals of its own."""
        if not self.accepts_goals:
            raise ThumperError(f"this run has its own goals; `thumper run` without a goal accepts {what}")

    def require_no_experiment(self) -> None:
        """Refuse while an experiment drives the board, or is about to."""
        if name := self.experiments.running or self.experiments.requested:
            raise ThumperError(f"{name} is running: cancel it first")

    def require_stationary(self, action: str) -> None:
        """Refuse `action` while the robot moves, also by an experiment."""
        self.require_no_experiment()
        if self.drive_manager.mode in (DriveMode.DRIVING, DriveMode.MANUAL, DriveMode.STOPPING):
            raise ThumperError(f"the robot must be stationary to {action}: stop it first")

    def prepare_map_change(self, reason: str) -> None:
        """Forget why an earlier drive ended, and switch the motors of an armed robot off.

        What follows changes the map or its use, and may take longer than the board's time-out.
        """
        self.drive_manager.forget_reason()
        if self.drive_manager.mode is DriveMode.HOLDING:
            self.drive_manager.disarm(reason)

    def require_motors_off(self, what: str) -> None:
        """Refuse `what` while the motors are on."""
        if self.drive_manager.mode is not DriveMode.IDLE:
            raise ThumperError(f"{what} starts with the motors off: stop and disarm the robot first")
