"""Manual driving that does not touch what the lidar and the map show (Nav2's `assisted_teleop`). Pure.

Nor does it back up, or swing the tail, over ground that the lidar has never seen.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.field_of_view import FieldOfView
from thumper.maps.occupancy_grid import OCCUPIED, OccupancyGrid
from thumper.navigation.costmap.local_model import ObstaclePoints
from thumper.navigation.navigator import USUAL_PERIOD_S
from thumper.navigation.safety.collision_monitor import UNSEEN, CollisionMonitor, with_cure
from thumper.runtime.sensor_inputs import BLIND_S
from thumper.runtime.state_estimator import RobotState

REACH_M = 1.2  # of the map around the robot: more than its way to a stop
FRACTIONS = (1.0, 0.5, 0.25)  # of the speed, tried in turn
OCCUPIED_PERCENT = 0.65 * OCCUPIED  # as map_server's default
EDGE_RAD = 0.05
WALL_ERROR_M = 0.05  # of a wall that only the map shows: half a cell, and the error of the pose in the map
NEAR = "slowed; an obstacle is near"
CURE = "drive ahead and look there first, or override the assistance"


@dataclass(frozen=True, slots=True, kw_only=True)
class AssistedCommand:
    """The twist that may be driven, and why it is not the commanded one."""

    twist: Twist2
    reason: str = ""


class AssistedTeleop:
    """Checks manual commands with the collision monitor of navigation."""

    def __init__(self, monitor: CollisionMonitor, view: FieldOfView) -> None:
        self._monitor = monitor
        self._view = view

    def limit(
        self,
        twist: Twist2,
        state: RobotState,
        obstacles: ObstaclePoints,
        grid: Callable[[], OccupancyGrid],
    ) -> AssistedCommand:
        """Return the command, slower or without its forward or turning part if it would touch something.

        `obstacles` are those of scan and memory, in the map, and unseen ground. Where the lidar does not
        look, the walls of the map count, too.
        Without scans, the command passes: the operator sees more than the robot.
        """
        if twist == Twist2():
            return AssistedCommand(twist=twist)
        if state.scan_age_s > BLIND_S:
            return AssistedCommand(twist=twist, reason="not assisted: no recent scan")
        points_m, error_m, seen = self._points_in_base(state, obstacles, grid)
        slow = self._monitor.slow_down(twist, points_m)
        candidates = [Twist2(v_m_s=f * slow.v_m_s, w_rad_s=f * slow.w_rad_s) for f in FRACTIONS]
        if twist.v_m_s and twist.w_rad_s:
            candidates.append(Twist2(w_rad_s=slow.w_rad_s))

        def stop_reason(candidate: Twist2) -> str | None:
            return self._monitor.stop_reason(
                candidate, state.twist, points_m, error_m, USUAL_PERIOD_S, seen=seen
            )

        wanted_stop = stop_reason(candidates[0])
        if wanted_stop is None:
            return AssistedCommand(twist=slow, reason="" if slow == twist else NEAR)
        if UNSEEN in wanted_stop and twist.w_rad_s and twist.v_m_s > 0.0:
            # Straight on, until the lidar has seen the ground that the tail would sweep.
            candidates.append(Twist2(v_m_s=FRACTIONS[1] * slow.v_m_s))
        stopped = with_cure(wanted_stop, CURE)
        for candidate in candidates[1:]:
            if stop_reason(candidate) is None:
                return AssistedCommand(twist=candidate, reason=f"slowed; {stopped}")
        return AssistedCommand(twist=Twist2(), reason=stopped)

    def _points_in_base(
        self, state: RobotState, obstacles: ObstaclePoints, grid: Callable[[], OccupancyGrid]
    ) -> ObstaclePoints:
        """Return obstacles and walls, and after them the unseen ground."""
        walls_m = np.empty((0, 2)) if state.lost else _walls_m(grid(), state.map_from_base)
        bearing_rad, range_m = self._view.bearings_and_ranges(state.map_from_base, walls_m)
        is_seen = self._view.contains(bearing_rad, range_m, edge_rad=EDGE_RAD)
        walls_m = walls_m[~is_seen]
        points_m, error_m, seen = obstacles
        return ObstaclePoints(
            np.concatenate((points_m[:seen], walls_m, points_m[seen:])),
            np.concatenate((error_m[:seen], np.full(len(walls_m), WALL_ERROR_M), error_m[seen:])),
            seen + len(walls_m),
        ).in_base(state.map_from_base)


def _walls_m(grid: OccupancyGrid, map_from_base: Pose2) -> FloatArray:
    """Return the centres of the occupied cells around the robot, shape (n, 2) [m]."""
    x_m, y_m = map_from_base.x_m, map_from_base.y_m
    (row_lo, col_lo), (row_hi, col_hi) = (
        grid.cell_of(x_m + side * REACH_M, y_m + side * REACH_M) for side in (-1.0, 1.0)
    )
    row_lo, col_lo = max(0, row_lo), max(0, col_lo)
    near = grid.cells[row_lo : max(0, row_hi + 1), col_lo : max(0, col_hi + 1)]
    cells = np.argwhere(near >= OCCUPIED_PERCENT)[:, ::-1] + (col_lo, row_lo)
    origin_m = (grid.origin_x_m, grid.origin_y_m)
    return np.asarray((cells + 0.5) * grid.resolution_m + origin_m, dtype=np.float64)
