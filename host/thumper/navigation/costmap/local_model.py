"""The obstacles round the robot, from map, scan and memory: as costmaps and as points."""

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.field_of_view import FieldOfView
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_costmap, build_window
from thumper.navigation.costmap.layers import CostmapLayers
from thumper.navigation.costmap.obstacle_memory import ObstacleMemory, ObstacleMemoryOptions
from thumper.navigation.costmap.scan_averaging import averaged_hits
from thumper.navigation.footprint import Footprint


class LocalModel:
    """Combines each cycle's map and scan with the obstacles that the lidar no longer sees."""

    def __init__(
        self,
        options: CostmapOptions,
        memory: ObstacleMemoryOptions,
        footprint: Footprint,
        keepout: OccupancyGrid | None,
        view: FieldOfView,
    ) -> None:
        """`footprint` is the padded one; `keepout` is the mask of closed cells."""
        self._options = options
        self._footprint = footprint
        self._keepout = keepout
        self._view = view
        self._layers = CostmapLayers(footprint, options, keepout)
        radius_m = footprint.circumscribed_radius_m
        self._control_memory = ObstacleMemory(memory, memory.radius_m, view, radius_m)
        self._planning_memory = ObstacleMemory(memory, memory.planning_radius_m, view, radius_m)
        self.costmap: Costmap | None = None  # of the newest cycle, for planning
        self.hits_m: FloatArray = np.empty((0, 2))  # the newest scan's hits in map, averaged by surface
        self.obstacles_m: FloatArray = np.empty((0, 2))  # these hits and the points remembered near the robot
        self.position_error_m: FloatArray = np.empty(0)  # bound of each obstacle point's error

    def update(
        self, time_s: float, map_from_base: Pose2, grid: OccupancyGrid, hits_in_map: FloatArray
    ) -> Costmap:
        """Process a cycle's map and hits, shape (n, 2) [m]; return the costmap for planning."""
        hits_in_map = hits_in_map[np.isfinite(hits_in_map).all(axis=1)]
        self.hits_m = averaged_hits(map_from_base, hits_in_map, self._view)
        near_m = self._control_memory.update(time_s, map_from_base, self.hits_m)
        far_m = self._planning_memory.update(time_s, map_from_base, self.hits_m)
        self.obstacles_m = np.vstack((self.hits_m, near_m))
        self.position_error_m = np.concatenate(
            (np.zeros(len(self.hits_m)), self._control_memory.position_error_m)
        )
        self.costmap = self._layers.update(grid, np.vstack((self.hits_m, far_m)))
        return self.costmap

    def local_costmap(self, grid: OccupancyGrid, map_from_base: Pose2) -> Costmap:
        """Return the finer costmap round the robot, for the controllers."""
        return build_window(
            grid, self.obstacles_m, map_from_base, self._footprint, self._options, self._keepout
        )

    def static_costmap(self, grid: OccupancyGrid) -> Costmap:
        """Return the costmap without scan and memory, whose obstacles may have moved since."""
        return build_costmap(grid, np.empty((0, 2)), self._footprint, self._options, self._keepout)

    def forget_beyond(self, map_from_base: Pose2, radius_m: float) -> None:
        """Forget the remembered points further than this from the robot."""
        self._control_memory.forget_beyond(map_from_base, radius_m)
        self._planning_memory.forget_beyond(map_from_base, radius_m)
