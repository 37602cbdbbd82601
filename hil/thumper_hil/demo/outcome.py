"""One mission as the robot saw it and as it was."""

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
    """What a mission yielded; `truth` comes from the simulator, the rest from the robot."""

    mission: DemoMission
    result: DriveResult
    log: DriveLog
    grid: OccupancyGrid
    session: SavedSlamState
    truth: FloatArray  # columns time [s], x [m], y [m], heading [rad], ...; 100 rows a second
    collisions: int
    map_quality: MapQuality
    sim_time_s: float
    wall_time_s: float

    @property
    def goal_error_m(self) -> float:
        """True distance from the goal at the end."""
        x_m, y_m = self.truth[-1, 1:3]
        return math.hypot(x_m - self.mission.goal_x_m, y_m - self.mission.goal_y_m)

    @property
    def passed(self) -> bool:
        """Whether the mission reached what the thesis asked: the goal within 0.4 m, and nothing touched."""
        return self.result.reached and self.goal_error_m <= TOLERANCE_M and self.collisions == 0
