"""The obstacles round the robot, from map, scan and memory: as costmaps and as points."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.field_of_view import FieldOfView
from thumper.maps.occupancy_grid import UNKNOWN, OccupancyGrid
from thumper.navigation.costmap.bands import build_band
from thumper.navigation.costmap.costmap import Costmap, CostmapOptions, build_window, window_of
from thumper.navigation.costmap.filters import Masks
from thumper.navigation.costmap.glass import Glass
from thumper.navigation.costmap.layers import CostmapLayers
from thumper.navigation.costmap.local_frame import LocalFrame
from thumper.navigation.costmap.obstacle_memory import ObstacleMemory, ObstacleMemoryOptions
from thumper.navigation.costmap.scan_averaging import averaged_hits, confirmed_hits
from thumper.navigation.costmap.unseen_ground import UnseenGround
from thumper.navigation.footprint import Footprint
from thumper.navigation.state import CycleInput

REFRESH_S = 0.5  # between costmaps of a robot without a goal, which only people look at


class ObstaclePoints(NamedTuple):
    """Points that the robot must not touch, shape (n, 2) [m]."""

    points_m: FloatArray
    position_error_m: FloatArray  # shape (n,), a bound of each point's error
    seen: int  # the points before this index are obstacles, the others are unseen ground

    @classmethod
    def of_hits(cls, hits_m: FloatArray) -> "ObstaclePoints":
        """Return a scan's hits alone, shape (n, 2); rows that are not finite are left out."""
        finite_m = hits_m[np.isfinite(hits_m).all(axis=1)]
        return cls(finite_m, np.zeros(len(finite_m)), len(finite_m))

    def without_unseen(self) -> "ObstaclePoints":
        """Return the obstacles alone."""
        return ObstaclePoints(self.points_m[: self.seen], self.position_error_m[: self.seen], self.seen)

    def with_more(self, points_m: FloatArray, error_m: float) -> "ObstaclePoints":
        """Return these points and more obstacles, shape (k, 2), with this error of their positions."""
        return ObstaclePoints(
            np.vstack((points_m, self.points_m)),
            np.concatenate((np.full(len(points_m), error_m), self.position_error_m)),
            len(points_m) + self.seen,
        )

    def in_base(self, map_from_base: Pose2) -> "ObstaclePoints":
        """Return points in `map` as points in base_link."""
        return self._replace(points_m=map_from_base.inverse().apply(self.points_m))


NOTHING: FloatArray = np.empty((0, 2))
NO_OBSTACLES = ObstaclePoints(NOTHING, np.empty(0), 0)


def _none(points_m: FloatArray) -> NDArray[np.bool_]:
    return np.zeros(len(points_m), np.bool_)


class LocalModel:
    """Combines each cycle's map and scan with the obstacles that the lidar no longer sees."""

    def __init__(
        self,
        options: CostmapOptions,
        memory: ObstacleMemoryOptions,
        footprint: Footprint,
        padded: Footprint,
        view: FieldOfView,
    ) -> None:
        """`footprint` is the robot's own, `padded` the one of planning."""
        self._options = options
        self._footprint = padded
        self._keepout: Masks = ()
        self._view = view
        self._layers = CostmapLayers(padded, options)
        remembered = partial(ObstacleMemory, memory, view=view, footprint=footprint, padded=padded)
        self._control_memory = remembered(radius_m=memory.radius_m)
        self._planning_memory = remembered(radius_m=memory.planning_radius_m)
        self._unseen = UnseenGround(footprint, view)
        self._glass = Glass(view, footprint, memory.planning_radius_m)
        self._costs_s = -math.inf  # when `costmap` was computed
        self._frame = LocalFrame()
        self.map_from_local = Pose2()  # of the frame in which what is remembered rests
        self.costmap: Costmap | None = None  # of the newest cycle, for planning
        self.local_costmap: Costmap | None = None  # finer, round the robot, for the controllers
        self.pose_costmap: Costmap | None = None  # the same with unseen ground open, if there is any
        self.move_ahead_m = 0.0  # see `UnseenGround.move_ahead_m`
        self._window: tuple[OccupancyGrid, FloatArray] | None = None
        self._fine: Costmap | None = None
        self.hits_m: FloatArray = np.empty((0, 2))  # the newest scan's hits in map, averaged by surface
        self.obstacles = NO_OBSTACLES  # in map, near the robot; also up to date after `observe`
        # Which points, shape (n, 2), are on somebody who walks: not in the costmaps, as they will have gone.
        self.are_walking: Callable[[FloatArray], NDArray[np.bool_]] = _none

    def set_keepout(self, keepout: Masks) -> None:
        """Replace the keep-out masks; they act from the next cycle on."""
        self._keepout = keepout
        self._layers.set_keepout(keepout)

    def observe(self, cycle: CycleInput) -> tuple[OccupancyGrid, FloatArray]:
        """Bring `obstacles` up to date, in each cycle; return the window of the map, and the unseen cells."""
        self._follow_map(cycle)
        time_s, base, scan_pose = cycle.time_s, cycle.map_from_base, cycle.scan_pose
        self._see(cycle)
        self._glass.update(time_s, scan_pose, self.hits_m)
        near_m = self._control_memory.update(time_s, base, self.hits_m, scan_pose)
        seen_m = np.vstack((self.hits_m, self._glass.points_m, near_m))

        window = window_of(cycle.grid, base, self._options)
        if cycle.lost:  # what the map shows is somewhere else
            window.cells.fill(UNKNOWN)
        unseen_m = self._unseen.update(window, base, self.hits_m, scan_pose)
        error_m = self._control_memory.position_error_m
        self.obstacles = ObstaclePoints(
            points_m=np.vstack((seen_m, unseen_m)),
            position_error_m=np.concatenate(
                (np.zeros(len(seen_m) - len(near_m)), error_m, np.zeros(len(unseen_m)))
            ),
            seen=len(seen_m),
        )
        return window, unseen_m

    def see_only(self, hits_in_map_m: FloatArray) -> None:
        """Let `obstacles` be these hits, shape (n, 2), without memory and unseen ground."""
        self.obstacles = ObstaclePoints.of_hits(hits_in_map_m)

    def update(self, cycle: CycleInput) -> Costmap | None:
        """Process a cycle's map and hits; return the costmap for planning, None until it is complete."""
        window, unseen_m = self.observe(cycle)
        base, seen_m = cycle.map_from_base, self.obstacles.points_m[: self.obstacles.seen]
        still_m = seen_m[~self.are_walking(seen_m)]
        self.move_ahead_m = self._unseen.move_ahead_m(unseen_m, base)
        closed_m = self._unseen.beyond_slack(unseen_m, base)
        self.local_costmap = self._window_costs(window, still_m, closed_m)
        self.pose_costmap = self._window_costs(window, still_m, NOTHING) if len(unseen_m) else None
        self._window, self._fine = (window, still_m), None
        far_m = np.vstack((self.hits_m, self._glass.points_m, self._far_hits(cycle)))
        self.costmap = self._layers.update(cycle.grid, far_m[~self.are_walking(far_m)])
        self._costs_s = cycle.time_s
        return self.costmap

    def refresh(self, cycle: CycleInput, *, parked: bool) -> None:
        """Bring `costmap` up to date at times in cycles without `update`: what a drive saw may be gone.

        A `parked` robot remembers nothing new, and needs no `observe` before.
        """
        if self.costmap is None or cycle.lost or cycle.time_s < self._costs_s + REFRESH_S:
            return
        self._costs_s = cycle.time_s
        if parked:
            self._follow_map(cycle)
            self._see(cycle)
            base, scan_pose = cycle.map_from_base, cycle.scan_pose
            far_m = self._planning_memory.recheck(cycle.time_s, base, self.hits_m, scan_pose)
        else:
            far_m = self._far_hits(cycle)
        self.costmap = self._layers.update(cycle.grid, np.vstack((self.hits_m, far_m)))

    def _see(self, cycle: CycleInput) -> None:
        hits_m = cycle.hits_in_map_m[np.isfinite(cycle.hits_in_map_m).all(axis=1)]
        self.hits_m = averaged_hits(cycle.scan_pose, hits_m, self._view)

    def _far_hits(self, cycle: CycleInput) -> FloatArray:
        """Return the hits that the planner remembers, shape (n, 2); remember those of the newest scan."""
        new_m = self.hits_m[confirmed_hits(self.hits_m)]
        base, scan_pose = cycle.map_from_base, cycle.scan_pose
        return self._planning_memory.update(cycle.time_s, base, self.hits_m, scan_pose, new_m=new_m)

    def fine_costmap(self) -> Costmap:
        """Return the costs round the robot, with unseen ground open, in cells of half the size."""
        assert self._window is not None  # the model was updated
        if self._fine is None:
            window, seen_m = self._window
            finer = replace(
                window, cells=window.cells.repeat(2, 0).repeat(2, 1), resolution_m=0.5 * window.resolution_m
            )
            self._fine = self._window_costs(finer, seen_m, NOTHING)
        return self._fine

    def static_band(self, grid: OccupancyGrid, begin: int, end: int) -> Costmap:
        """Return rows of the costmap without scan and memory, whose obstacles may have moved since."""
        return build_band(grid, slice(begin, end), self._footprint, self._options, self._keepout)

    def _window_costs(self, window: OccupancyGrid, seen_m: FloatArray, unseen_m: FloatArray) -> Costmap:
        return build_window(window, seen_m, unseen_m, self._footprint, self._options, self._keepout)

    def forget_beyond(self, map_from_base: Pose2, radius_m: float) -> None:
        """Forget the remembered points further than this from the robot."""
        self._control_memory.forget_beyond(map_from_base, radius_m)
        self._planning_memory.forget_beyond(map_from_base, radius_m)
        self._glass.forget_beyond(map_from_base, radius_m)

    def _follow_map(self, cycle: CycleInput) -> None:
        """Let all that is remembered keep its place relative to the robot when the map corrects the pose."""
        new_from_old = self._frame.update(cycle.map_from_base, cycle.map_from_odom)
        self.map_from_local = new_from_old @ self.map_from_local
        for remembered in (self._control_memory, self._planning_memory, self._unseen, self._glass):
            remembered.move(new_from_old)
