"""The outcome of one mission: the robot's estimate and the ground truth."""

import math
from dataclasses import dataclass

from thumper.common.geometry import FloatArray
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.runtime.drive_log import DriveLog
from thumper.runtime.drive_result import DriveResult
from thumper.slam.saved_state import SavedSlamState
from thumper_hil.demo.map_error import MapQuality
from thumper_hil.demo.missions import TOLERANCE_M, DemoMission


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Data of a finished mission; `truth` comes from the simulator, the rest from the robot."""

    mission: DemoMission
    result: DriveResult
    log: DriveLog
    grid: OccupancyGrid
    session: SavedSlamState
    truth: FloatArray  # columns time [s], x [m], y [m], heading [rad], ...; 100 rows per second
    collisions: int
    map_quality: MapQuality
    sim_time_s: float
    wall_time_s: float

    @property
    def goal_error_m(self) -> float:
        """True distance to the goal at the end [m]."""
        x_m, y_m = self.truth[-1, 1:3]
        return math.hypot(x_m - self.mission.goal_x_m, y_m - self.mission.goal_y_m)

    @property
    def passed(self) -> bool:
        """True if the mission meets the thesis's requirement: goal within 0.4 m, no collision."""
        return self.result.reached and self.goal_error_m <= TOLERANCE_M and self.collisions == 0
