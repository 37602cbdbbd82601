"""Mapping with loops: the single-hypothesis mapper on the map nearby, and a pose graph that bends the rest.

The front end matches against the *active* map alone: the places that the graph connects to the robot by a
short way. Where the robot comes back after a long loop,
the old map stays out of the match until a search has found
where the new one lies on it; so drift shows as drift, and no scan is torn between two positions.
"""

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.deskew import scan_points
from thumper.lidar.scan import Scan
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.grid.grid_mapper import GridMapper, GridMapperOptions
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.mapper import MapperUpdate, PoseQuality
from thumper.slam.pose_graph.loop_closure import LoopSearch
from thumper.slam.pose_graph.map_rebuild import MapRebuild
from thumper.slam.pose_graph.optimizer import Edge, Solver
from thumper.slam.pose_graph.submaps import SubmapGraph

SCANS_AT_ONCE = 6  # entered in one part of the work while a map is drawn again: a few ms
PART_EVERY_M, MOST_PARTS = 0.1, 4  # of way since the last scan: after more of it there was more time


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopOptions:
    """Options of loop closing; those of `GridMapperOptions` hold for the front end."""

    place_m: Annotated[float, Gt(0)] = 2.0  # way within one place: its scans move as one
    active_m: Annotated[float, Gt(0)] = 60.0  # way in the graph up to which places are in the active map
    drift_per_m: Annotated[float, Gt(0)] = 0.03  # how much the search window grows a metre of loop
    drift_rad_per_m: Annotated[float, Gt(0)] = 0.003  # and its angle
    largest_window_m: Annotated[float, Gt(0)] = 12.0  # half side of the window at most
    accept_score: Annotated[float, Interval(gt=0, le=1)] = 0.6  # beams that a closure must explain
    rival_ratio: Annotated[float, Interval(gt=0, le=1)] = 0.9  # refused if another place explains this share


class GraphMapper:
    """Loop-closing SLAM behind the `Mapper` protocol."""

    def __init__(
        self,
        options: GridMapperOptions | None = None,
        loops: LoopOptions | None = None,
        *,
        base_from_laser: Pose2 | None = None,
        map_from_base: Pose2 | None = None,
    ) -> None:
        """Start with an empty map; `map_from_base` is where the first scan is taken."""
        self._options = options or GridMapperOptions()
        self._loops = loops or LoopOptions()
        self._base_from_laser = base_from_laser or Pose2()
        self._front = GridMapper(
            self._options, base_from_laser=self._base_from_laser, map_from_base=map_from_base
        )
        self.places = SubmapGraph(self._loops.place_m)
        self._search = LoopSearch(
            self._options, self.places, self._loops.drift_per_m, self._loops.drift_rad_per_m,
            self._loops.largest_window_m, self._loops.accept_score, self._loops.rival_ratio,
        )  # fmt: skip
        self._active: set[int] = set()
        self._trimmed_at_m = 0.0
        self._solver: Solver | None = None
        self._drawn: MapRebuild | None = None  # the next active map
        self._joining: MapRebuild | None = (
            None  # old places that have come near, into the active map as it is
        )
        self._world: MapRebuild | None = None  # the whole map, where it is more than the active one
        self._next_world: MapRebuild | None = None
        self._graph_from_front = (
            Pose2()
        )  # until the next active map is drawn, the front end works in the old one
        self.loops_closed = 0

    @property
    def map_from_odom(self) -> Pose2:
        """The correction that the last match, and the loops closed since, found."""
        return self._graph_from_front @ self._front.map_from_odom

    def quality(self) -> PoseQuality:
        """How sure the newest pose is."""
        return self._front.quality()

    def resume_at(self, map_from_base: Pose2, map_from_odom: Pose2, covariance: FloatArray) -> None:
        """Go on with the same map from a pose that somebody else found at a newer scan."""
        front_from_graph = self._graph_from_front.inverse()
        self._front.resume_at(front_from_graph @ map_from_base, front_from_graph @ map_from_odom, covariance)

    def path(self) -> FloatArray:
        """x, y, theta at each scan so far, as all loops closed since say, shape (scans, 3).

        It first ends all work that `update` has spread over the next scans.
        """
        while self._solver or self._joining or self._drawn or self._next_world or self._search.busy:
            self._work()
        return self.places.path()

    def grid(self) -> OccupancyGrid:
        """The whole map: free, occupied or unknown; after a loop it follows some scans later."""
        if self._world is None:
            return self._front.grid()
        return self._world.cells.grid(percent=False)

    def counts(self) -> HitCounts:
        """Hits and misses of the whole map (a copy), as `grid` shows it."""
        return (self._front if self._world is None else self._world).cells.counts()

    def warm_up(self) -> None:
        """Compile the kernels (or load them from the cache) on a map that is thrown away."""
        self._front.warm_up()
        self._search.warm_up()
        edge = Edge(
            first=0, second=1, first_from_second=Pose2(), std_m=1.0, std_rad=1.0, loop=False, length_m=0.0
        )
        Solver(np.zeros((2, 3)), [edge]).step()

    def update(self, odom_from_base: Pose2, scan: Scan, twist: Twist2) -> MapperUpdate:
        """Take the odometry pose at `scan.time_s` (beam 0) and the speed during the turn, for de-skewing."""
        update = self._front.update(odom_from_base, scan, twist)
        pose = self._graph_from_front @ update.map_from_base
        closed = self.loops_closed
        points = None
        if update.integrated:
            points = scan_points(scan, twist, self._base_from_laser, self._options.usable_range_m)
        driven_m = self.places.driven_m
        new_place = self.places.add(pose, points)
        if update.integrated:
            self._active.add(self.places.newest)
        if self._drawn is not None and self._drawn.chosen is not None:
            self._drawn.chosen.add(self.places.newest)
        if new_place and self._solver is None and self._graph_from_front == Pose2():
            self._place_finished()
        parts = round((self.places.driven_m - driven_m) / PART_EVERY_M)
        for _ in range(max(1, min(MOST_PARTS, parts))):
            self._work()
        # By now the loop may be closed, or the front end work in another map.
        pose = self._graph_from_front @ self._front.map_from_base
        return replace(update, map_from_base=pose, jumped=self.loops_closed > closed)

    def _place_finished(self) -> None:
        near = self.places.within(self._loops.active_m)
        self.places.tie(near)
        if not self._search.busy:
            self._search.begin(near)
            far_m = self.places.driven_m - self._trimmed_at_m
            if self._drawn is None and far_m >= 0.5 * self._loops.active_m:
                # Now and then drop from the active map what has become far along the graph.
                self._trimmed_at_m = self.places.driven_m
                if not self._active <= near.keys():
                    self._draw_active()
        if self._joining is None and not near.keys() <= self._active:
            # Where the map of the last round ends, the robot would begin a second one beside it.
            self._joining = MapRebuild(cells=self._front.cells, chosen=near.keys() - self._active)

    def _work(self) -> None:
        """Do a part of what closing a loop takes: of the solver, of a map, of the search."""
        if self._solver is not None:
            if self._solver.step():
                before = self.places.pose(self.places.newest)
                self.places.adopt(self._solver.poses)
                bend = self.places.pose(self.places.newest) @ before.inverse()
                self._graph_from_front = bend @ self._graph_from_front
                self._solver = None
                self.loops_closed += 1
                self._joining = None
                self._draw_active()
                self._next_world = MapRebuild(cells=self._empty(distances=False))
        elif self._joining is not None:
            if self._joining.draw(self.places, SCANS_AT_ONCE):
                self._active |= self._joining.chosen or set()
                self._joining = None
        elif self._drawn is not None:
            if self._drawn.draw(self.places, SCANS_AT_ONCE):
                self._front.replace_map(self._drawn.cells, self._graph_from_front @ self._front.map_from_base)
                self._graph_from_front = Pose2()
                self._active = self._drawn.chosen or set()
                self._drawn = None
                if self._world is None and self._next_world is None:
                    self._next_world = MapRebuild(cells=self._empty(distances=False))
        elif self._next_world is not None:
            if self._next_world.draw(self.places, SCANS_AT_ONCE):
                self._world, self._next_world = self._next_world, None
        elif self._world is not None:
            self._world.draw(self.places, SCANS_AT_ONCE)
        if self._search.work():
            self._solver = Solver(self.places.poses, self.places.edges)

    def _draw_active(self) -> None:
        self._trimmed_at_m = self.places.driven_m
        self._drawn = MapRebuild(cells=self._empty(), chosen=set(self.places.within(self._loops.active_m)))

    def _empty(self, *, distances: bool = True) -> HitGrid:
        options = self._options
        return HitGrid(options.resolution_m, options.reach_m, options.occupied_fraction, distances=distances)
