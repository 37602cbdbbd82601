"""Mapping with loops: the single-hypothesis mapper on the map nearby, and a pose graph that bends the rest.

The front end matches against the *active* map alone: the places that the graph connects to the robot by a
short way. Where the robot comes back after a long loop,
the old map stays out of the match until a search has found
where the new one lies on it; so drift shows as drift, and no scan is torn between two positions.
"""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt, Interval

from thumper.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.scan import Scan
from thumper.mapping.cells import Cells
from thumper.mapping.grid import OccupancyGrid
from thumper.mapping.grid_mapper import GridMapper, GridMapperOptions
from thumper.mapping.loop_search import LoopSearch
from thumper.mapping.mapper import MapperUpdate, PoseQuality
from thumper.mapping.place_graph import PlaceGraph
from thumper.mapping.scan_points import scan_points


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
        self.places = PlaceGraph(self._loops.place_m)
        self._search = LoopSearch(
            self._options, self.places, self._loops.drift_per_m, self._loops.drift_rad_per_m,
            self._loops.largest_window_m, self._loops.accept_score, self._loops.rival_ratio,
        )  # fmt: skip
        self._active: set[int] = set()
        self._trimmed_at_m = 0.0
        self._world: Cells | None = None
        self._world_scans = 0
        self.loops_closed = 0

    @property
    def map_from_odom(self) -> Pose2:
        """The correction that the last match found."""
        return self._front.map_from_odom

    def quality(self) -> PoseQuality:
        """How sure the newest pose is."""
        return self._front.quality()

    def continue_from(self, map_from_base: Pose2, map_from_odom: Pose2, covariance: FloatArray) -> None:
        """Go on with the same map from a pose that somebody else found at a newer scan."""
        self._front.continue_from(map_from_base, map_from_odom, covariance)

    def path(self) -> FloatArray:
        """x, y, theta at each scan so far, as all loops closed since say, shape (scans, 3)."""
        return self.places.path()

    def grid(self) -> OccupancyGrid:
        """The whole map (a copy): free, occupied or unknown."""
        if self._active.issuperset(range(self.places.newest + 1)):
            return self._front.grid()
        if self._world is None:
            self._world, self._world_scans = self._empty(), 0
        self._world_scans = self.places.enter(self._world, self._world_scans)
        return self._world.grid(percent=False)

    def warm_up(self) -> None:
        """Compile the kernels (or load them from the cache) on a map that is thrown away."""
        self._front.warm_up()
        self._search.warm_up()

    def update(self, odom_from_base: Pose2, scan: Scan, twist: Twist2) -> MapperUpdate:
        """Take the odometry pose at `scan.time_s` (beam 0) and the speed during the turn, for de-skewing."""
        update = self._front.update(odom_from_base, scan, twist)
        pose = update.map_from_base
        points = None
        if update.integrated:
            points = scan_points(scan, twist, self._base_from_laser, self._options.usable_range_m)
        new_place = self.places.add(pose, points)
        if not update.integrated:
            return update
        self._active.add(self.places.newest)
        if new_place:
            corrected = self._close(pose)
            if corrected is not None:
                self.loops_closed += 1
                return MapperUpdate(map_from_base=corrected, match_score=update.match_score, integrated=True)
            self._trim(pose)
        return update

    def _close(self, pose: Pose2) -> Pose2 | None:
        """Look for a place seen before a long loop; return the corrected pose once one is sure."""
        near = self.places.within(self._loops.active_m)
        self.places.tie(near)
        if not self._search.look(near):
            return None
        place = self.places.newest
        before = self.places.pose(place)
        self.places.optimise()
        corrected = self.places.pose(place) @ before.inverse() @ pose
        self._world = None
        self._rebuild(corrected)
        return corrected

    def _trim(self, pose: Pose2) -> None:
        """Now and then drop from the active map what has become far along the graph."""
        if self.places.driven_m - self._trimmed_at_m < 0.5 * self._loops.active_m:
            return
        self._trimmed_at_m = self.places.driven_m
        if not self._active <= self.places.within(self._loops.active_m).keys():
            self._rebuild(pose)

    def _rebuild(self, pose: Pose2) -> None:
        self._active = set(self.places.within(self._loops.active_m))
        cells = self._empty()
        self.places.enter(cells, 0, self._active)
        self._front.restart(cells, pose)
        self._trimmed_at_m = self.places.driven_m

    def _empty(self) -> Cells:
        options = self._options
        return Cells(options.resolution_m, options.reach_m, options.occupied_fraction)
