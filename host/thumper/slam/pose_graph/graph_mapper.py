"""Mapping with loop closure: a scan matcher on the active map, and a pose graph of submaps behind it.

The front end matches against the *active* map alone: the submaps that the graph connects to the robot over a
short distance. When the robot returns after a long loop, the old map stays out of the match until a search
has located the new one on it. So drift stays visible as drift, and no scan is torn between two positions.
"""

import math

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.deskew import HIT, ScanPoints
from thumper.lidar.scan import Scan
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.grid.growing_grid import Distances, HitGrid
from thumper.slam.grid.options import GridMapperOptions
from thumper.slam.mapper import MapperUpdate, PoseQuality
from thumper.slam.pose_graph.kept_scan import keep_scan
from thumper.slam.pose_graph.loop_closure import LoopOptions, LoopSearch
from thumper.slam.pose_graph.map_rebuild import MapRebuild
from thumper.slam.pose_graph.optimizer import Edge, Solver
from thumper.slam.pose_graph.self_check import find_contradiction
from thumper.slam.pose_graph.submaps import SubmapGraph

# Parts of work per scan: one per this distance since the last scan, which took time, too.
PART_EVERY_M, MAX_PARTS = 0.1, 3
# Parts per scan from a loop closure until the active map is complete again. Until then walls lie in it twice,
# or are missing, and a match slides along equal doorways: a few metres of this cost the pose.
URGENT_PARTS = 4
# The front end first continues in a map of this distance along the graph: a sixth of the whole is soon ready.
# The rest is added to it.
NUCLEUS_M = 20.0


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
        """Start with an empty map; `map_from_base` is the pose of the first scan."""
        self._options = options or GridMapperOptions()
        self._loops = loops or LoopOptions()
        self._base_from_laser = base_from_laser or Pose2()
        self._front_end = GridMapper(
            self._options, base_from_laser=self._base_from_laser, map_from_base=map_from_base
        )
        self.submaps = SubmapGraph()
        self._search = LoopSearch(self._options, self._loops, self.submaps)
        self._solver: Solver | None = None
        self._active: set[int] = set()  # submaps in the active map
        self._active_m = self._loops.active_m  # distance along the graph that the active map covers so far
        self._widens = False  # whether parts of it are missing since a loop closure
        self._trimmed_at_m = 0.0  # distance driven when the active map was last rebuilt
        # Maps under construction: old submaps to add to the active map, the next active map, and the whole
        # map, once it is larger than the active one, with its successor.
        self._additions: MapRebuild | None = None
        self._next_active: MapRebuild | None = None
        self._whole_map: MapRebuild | None = None
        self._next_whole_map: MapRebuild | None = None
        # Until the next active map is complete, the front end works in the old one.
        self._graph_from_front_end = Pose2()
        self.loops_closed = 0

    @property
    def map_from_odom(self) -> Pose2:
        """The correction found by the newest match and the loops closed since."""
        return self._graph_from_front_end @ self._front_end.map_from_odom

    def quality(self) -> PoseQuality:
        """Return the covariance of the newest pose and whether it is lost."""
        return self._front_end.quality()

    @property
    def kidnapped(self) -> bool:
        """Whether the robot was carried away: only a search of the whole map can find it."""
        return self._front_end.kidnapped

    def resume_at(self, map_from_base: Pose2, map_from_odom: Pose2, covariance: FloatArray) -> None:
        """Continue in the same map from a pose that another estimator found at a newer scan."""
        front_end_from_graph = self._graph_from_front_end.inverse()
        self._front_end.resume_at(
            front_end_from_graph @ map_from_base, front_end_from_graph @ map_from_odom, covariance
        )

    def path(self) -> FloatArray:
        """Return x, y, theta at each scan, corrected by all loops, shape (scans, 3).

        First completes all work that `update` has spread over the next scans.
        """
        while self._solver or self._builds_map or self._search.busy:
            self._run_parts(1)
        return self.submaps.path()

    def contradiction(self) -> str:
        """Return where a place is drawn twice; empty if none is. It takes seconds for a large map."""
        found = find_contradiction(self.submaps)
        return found.text if found else ""

    def grid(self) -> OccupancyGrid:
        """Return the whole map as free, occupied or unknown. After a loop it follows some scans later."""
        if self._whole_map is None:
            return self._front_end.grid()
        return self._whole_map.hit_grid.grid(percent=False)

    def counts(self) -> HitCounts:
        """Return a copy of the hits and misses of the map that `grid` returns."""
        return (self._front_end if self._whole_map is None else self._whole_map).hit_grid.counts()

    def warm_up(self) -> None:
        """Compile the kernels, or load them from the cache, on a scratch map."""
        self._front_end.warm_up()
        self._search.warm_up()
        beams = ScanPoints(
            origins_m=np.zeros((1, 2)), ends_m=np.ones((1, 2)), kinds=np.array([HIT], np.uint8)
        )
        keep_scan(0, Pose2(), beams)
        rebuilt = self._empty_grid("deferred")
        rebuilt.insert(Pose2(), beams)
        rebuilt.add_distances()
        edge = Edge(
            first=0, second=1, first_from_second=Pose2(), information=np.eye(3), loop=False, length_m=0.0
        )
        Solver(np.zeros((2, 3)), [edge]).run_part()

    def update(
        self, odom_from_base: Pose2, scan: Scan, twist: Twist2, *, turn_std_rad: float = math.inf
    ) -> MapperUpdate:
        """Process one scan; see `Mapper.update`."""
        loops_before, driven_before_m = self.loops_closed, self.submaps.driven_m
        update = self._front_end.update(odom_from_base, scan, twist, turn_std_rad=turn_std_rad)
        if self._add_node(update):
            self._on_submap_finished()
        parts = round((self.submaps.driven_m - driven_before_m) / PART_EVERY_M)
        urgent = self._graph_from_front_end != Pose2() or self._widens
        self._run_parts(URGENT_PARTS if urgent else max(1, min(MAX_PARTS, parts)))
        # By now a loop may be closed, or the front end may work in another map.
        pose = self._graph_from_front_end @ self._front_end.map_from_base
        return MapperUpdate(
            map_from_base=pose,
            match_score=update.match_score,
            integrated=update.integrated,
            jumped=self.loops_closed > loops_before,
        )

    def _add_node(self, update: MapperUpdate) -> bool:
        """Add the scan to the graph; return whether a submap was finished in an up-to-date map."""
        points = self._front_end.points if update.integrated else None
        started = self.submaps.add(self._graph_from_front_end @ update.map_from_base, points)
        if update.integrated:
            self._active.add(self.submaps.newest)
        if self._next_active is not None and self._next_active.chosen is not None:
            self._next_active.chosen.add(self.submaps.newest)
        return started and self._solver is None and self._graph_from_front_end == Pose2()

    def _on_submap_finished(self) -> None:
        """Connect the submap just finished, start a loop search, and keep the active map up to date."""
        near = self.submaps.within(self._loops.active_m)
        self.submaps.connect_to_nearest(near, self._loops.accept_score)
        if not self._search.busy:
            self._search.start(near)
            far_m = self.submaps.driven_m - self._trimmed_at_m
            if self._next_active is None and far_m >= 0.5 * self._loops.active_m:
                # Now and then drop what is now far along the graph from the active map.
                self._trimmed_at_m = self.submaps.driven_m
                if not self._active <= near.keys():
                    self._rebuild_active()
        if self._additions is None and self._active_m == self._loops.active_m:
            # Where the map of the last round ends, the robot would start a second one beside it.
            self._extend_active(near)

    def _extend_active(self, near: dict[int, float]) -> None:
        """Start to add the submaps that are missing in the active map, out to the distance it covers."""
        missing = {submap for submap, m in near.items() if m <= self._active_m} - self._active
        if missing:
            self._additions = MapRebuild(hit_grid=self._front_end.hit_grid, chosen=missing)

    @property
    def _builds_map(self) -> bool:
        return bool(self._additions or self._next_active or self._next_whole_map)

    def _run_parts(self, parts: int) -> None:
        """Run parts of the solver or of a map under construction, and of the loop search; both share them."""
        both = self._search.busy and (self._solver is not None or self._builds_map)
        for _ in range(max(1, parts - both)):
            self._run_map_part()
            if self._search.run_part():
                self._solver = Solver(self.submaps.poses, self.submaps.edges)

    def _run_map_part(self) -> None:
        """Run one part of the solver or of a map under construction."""
        if self._solver is not None:
            if self._solver.run_part():
                self._apply_solution(self._solver)
        elif self._additions is not None:
            if self._additions.insert_part(self.submaps):
                self._active |= self._additions.chosen or set()
                self._additions = None
                self._widen_active()
        elif self._next_active is not None:
            if self._next_active.insert_part(self.submaps):
                self._switch_active(self._next_active)
        elif self._next_whole_map is not None:
            if self._next_whole_map.insert_part(self.submaps):
                self._whole_map, self._next_whole_map = self._next_whole_map, None
        elif self._whole_map is not None:
            self._whole_map.insert_part(self.submaps)

    def _apply_solution(self, solver: Solver) -> None:
        """Correct the submaps, and rebuild the maps from them."""
        before = self.submaps.pose(self.submaps.newest)
        self.submaps.apply_correction(solver.poses)
        correction = self.submaps.pose(self.submaps.newest) @ before.inverse()
        self._graph_from_front_end = correction @ self._graph_from_front_end
        self._solver = None
        self.loops_closed += 1
        self._front_end.trust_pose()
        self._additions = None
        self._rebuild_active(NUCLEUS_M)
        self._next_whole_map = self._empty_whole_map()

    def _switch_active(self, rebuilt: MapRebuild) -> None:
        """Let the front end continue in the rebuilt active map."""
        pose = self._graph_from_front_end @ self._front_end.map_from_base
        self._front_end.replace_map(rebuilt.hit_grid, pose)
        self._graph_from_front_end = Pose2()
        self._active = rebuilt.chosen or set()
        self._next_active = None
        self._widen_active()
        if self._whole_map is None and self._next_whole_map is None:
            self._next_whole_map = self._empty_whole_map()

    def _widen_active(self) -> None:
        """Add what is missing in the active map after a loop closure, the nearest submaps first."""
        while self._additions is None and self._active_m < self._loops.active_m:
            self._active_m = min(2.0 * self._active_m, self._loops.active_m)
            self._extend_active(self.submaps.within(self._active_m))
        self._widens = self._additions is not None

    def _rebuild_active(self, distance_m: float = math.inf) -> None:
        """Start the next active map, with the submaps up to this distance."""
        self._trimmed_at_m = self.submaps.driven_m
        self._active_m = min(distance_m, self._loops.active_m)
        near = self.submaps.within(self._loops.active_m)
        self._next_active = MapRebuild(
            hit_grid=self._empty_grid("deferred"),
            chosen={submap for submap, m in near.items() if m <= self._active_m},
        )

    def _empty_whole_map(self) -> MapRebuild:
        return MapRebuild(hit_grid=self._empty_grid("never"))

    def _empty_grid(self, distances: Distances) -> HitGrid:
        options = self._options
        grid = HitGrid(options.resolution_m, options.reach_m, options.occupied_fraction, distances=distances)
        grid.scratch = self._front_end.hit_grid.scratch
        return grid
