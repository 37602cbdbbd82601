"""What stands round the robot, by map, scan and memory: as costmaps to plan on and as points not to touch."""

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
    """Takes each cycle's map and scan, and remembers what the lidar no longer sees."""

    def __init__(
        self,
        options: CostmapOptions,
        memory: ObstacleMemoryOptions,
        footprint: Footprint,
        keepout: OccupancyGrid | None,
        view: FieldOfView,
    ) -> None:
        """`footprint` is that of planning, with its padding; `keepout` is a mask of cells that are shut."""
        self._options = options
        self._footprint = footprint
        self._keepout = keepout
        self._view = view
        self._layers = CostmapLayers(footprint, options, keepout)
        hull_m = footprint.circumscribed_radius_m
        self._memory = ObstacleMemory(memory, memory.radius_m, view, hull_m)
        self._plan_memory = ObstacleMemory(memory, memory.planning_radius_m, view, hull_m)
        self.costmap: Costmap | None = None  # of the newest cycle
        self.seen_m: FloatArray = np.empty((0, 2))  # the newest scan's hits in map, averaged by surface
        self.points_m: FloatArray = np.empty((0, 2))  # these, and what is remembered near the robot
        self.spread_m: FloatArray = np.empty(0)  # how far off each of `points_m` may be

    def update(
        self, time_s: float, map_from_base: Pose2, grid: OccupancyGrid, hits_in_map: FloatArray
    ) -> Costmap:
        """Take a cycle's map and hits, shape (n, 2) [m]; return the costmap to plan on."""
        hits_in_map = hits_in_map[np.isfinite(hits_in_map).all(axis=1)]
        self.seen_m = averaged_hits(map_from_base, hits_in_map, self._view)
        near_m = self._memory.update(time_s, map_from_base, self.seen_m)
        far_m = self._plan_memory.update(time_s, map_from_base, self.seen_m)
        self.points_m = np.vstack((self.seen_m, near_m))
        self.spread_m = np.concatenate((np.zeros(len(self.seen_m)), self._memory.spread_m))
        self.costmap = self._layers.update(grid, np.vstack((self.seen_m, far_m)))
        return self.costmap

    def window(self, grid: OccupancyGrid, map_from_base: Pose2) -> Costmap:
        """The finer costmap round the robot, to control on."""
        return build_window(grid, self.points_m, map_from_base, self._footprint, self._options, self._keepout)

    def map_alone(self, grid: OccupancyGrid) -> Costmap:
        """The costmap without what is seen just now and remembered: it may have moved since."""
        return build_costmap(grid, np.empty((0, 2)), self._footprint, self._options, self._keepout)

    def forget_beyond(self, map_from_base: Pose2, radius_m: float) -> None:
        """Forget what is remembered further away from the robot."""
        self._memory.forget_beyond(map_from_base, radius_m)
        self._plan_memory.forget_beyond(map_from_base, radius_m)
