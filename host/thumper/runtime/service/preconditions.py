"""What must hold before a request is carried out. Each check raises ThumperError with the fix."""

from dataclasses import dataclass

import numpy as np

from thumper.common.errors import ThumperError
from thumper.runtime.drive.drive_manager import DriveManager, DriveMode
from thumper.runtime.service.experiments import Experiments
from thumper.runtime.state_estimator import RobotState

LANE_HALF_WIDTH_M = 0.25  # half of the robot, and 0.1 m that it may drift aside


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

    def require_free_lane(self, lane_m: float, state: RobotState) -> None:
        """Refuse to drive ahead and back by up to `lane_m` where the newest scan shows an obstacle."""
        x_m, y_m = state.map_from_base.inverse().apply(state.hits_in_map_m).T
        in_lane_m = x_m[(np.abs(y_m) < LANE_HALF_WIDTH_M) & (np.abs(x_m) < lane_m)]
        if not in_lane_m.size:
            return
        nearest_m = float(in_lane_m[np.argmin(np.abs(in_lane_m))])
        where = "ahead of" if nearest_m > 0.0 else "behind"
        raise ThumperError(
            f"an obstacle is {abs(nearest_m):.1f} m {where} the robot's centre, and the lane needs "
            f"{lane_m:g} m ahead and behind: put the robot where it is free, or turn it"
        )
