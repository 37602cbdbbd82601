"""Mapping and localisation behind one `Mapper`, to be switched while the robot runs."""

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.scan import Scan
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from thumper.slam.factory import PathMapper
from thumper.slam.grid.grid_mapper import GridMapper, GridMapperOptions
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.localization.amcl import Amcl
from thumper.slam.localization.options import AmclOptions
from thumper.slam.mapper import MapperUpdate, PoseQuality

PLACED_STD_M, PLACED_STD_RAD = 0.1, 0.05  # of a pose that a mapper gives to the localiser


class SlamModeSwitch:
    """Maps until told to localise, then keeps the map as it is until told to map on.

    The pose never jumps at a switch: whoever takes over begins where the other one was at the newest scan.
    """

    def __init__(
        self,
        mapper: PathMapper,
        mapping: GridMapperOptions | None = None,
        options: AmclOptions | None = None,
        *,
        base_from_laser: Pose2 | None = None,
    ) -> None:
        """Begin with mapping; `mapping` and `base_from_laser` must be the mapper's."""
        self._mapper, self._mapping = mapper, mapping or GridMapperOptions()
        self._options = options or AmclOptions()
        self._base_from_laser = base_from_laser
        self._odometry: Pose2 | None = None  # at the newest scan
        self._pose: Pose2 | None = None
        self._foreign: HitCounts | None = None  # the map localised in, where it is not the mapper's
        self._goes_on = False  # to map in it, once the place is known
        self.localiser: Amcl | None = None

    @property
    def map_from_odom(self) -> Pose2:
        """The correction that the newest scan led to."""
        return (self.localiser or self._mapper).map_from_odom

    def grid(self) -> OccupancyGrid:
        """The map so far, or the frozen one while localising."""
        return (self.localiser or self._mapper).grid()

    def counts(self) -> HitCounts:
        """What the map that `grid` shows is made of, to go on with another day."""
        return self._mapper.counts() if self._foreign is None else self._foreign

    def quality(self) -> PoseQuality:
        """How sure the newest pose is."""
        return (self.localiser or self._mapper).quality()

    @property
    def doing(self) -> str:
        """Whether it maps or localises, in words."""
        if self.localiser is None:
            return "mapping"
        return "localising, to map on once the place is known" if self._goes_on else "localising"

    @property
    def map_doubt(self) -> str:
        """Why the map localised in might be the wrong one; empty while it fits, and while mapping."""
        return self.localiser.map_doubt if self.localiser else ""

    @property
    def particle_poses(self) -> FloatArray | None:
        """x, y, theta of each particle, shape (n, 3); None from a method that has none."""
        poses: FloatArray | None = getattr(self.localiser or self._mapper, "particle_poses", None)
        return poses

    def path(self) -> FloatArray:
        """x, y, theta at each scan that was mapped, shape (scans, 3)."""
        return self._mapper.path()

    def warm_up(self) -> None:
        """Compile the kernels of both (or load them from the cache)."""
        self._mapper.warm_up()
        cells = np.full((40, 40), UNKNOWN, dtype=np.int8)
        cells[1:-1, 1:-1] = FREE
        cells[1:-1, 1] = OCCUPIED
        small = OccupancyGrid(cells=cells, resolution_m=0.1, origin_x_m=-2.0, origin_y_m=-2.0)
        Amcl(small, self._options).warm_up()

    def localise(self) -> None:
        """Freeze the own map and go on from the pose of the newest scan.

        Raises
        ------
        ThumperError
            Nothing has been mapped yet.
        """
        self._goes_on = False
        if self.localiser is None:
            self._start(self._mapper.grid(), self._pose or Pose2(), by_hand=False)

    def localise_in(self, grid: OccupancyGrid, map_from_base: Pose2 | None) -> None:
        """Go on in a map that was saved, at a pose given by hand, or looked for in all of it with None.

        Raises
        ------
        ThumperError
            There is no wall in the map.
        """
        self._start(grid, map_from_base)
        self._foreign, self._goes_on = HitCounts.from_grid(grid), False

    def continue_in(self, counts: HitCounts, map_from_base: Pose2 | None) -> None:
        """Go on mapping in a map of another day, as soon as it is known where in it the robot is.

        Until then it is localised in, from a pose given by hand, or looked for in all of it with None.

        Raises
        ------
        ThumperError
            There is no wall in the map.
        """
        self._start(counts.grid(self._mapping.occupied_fraction), map_from_base)
        self._foreign, self._goes_on = counts, True

    def set_pose(self, map_from_base: Pose2) -> None:
        """Say by hand where the robot is, roughly; the next scan decides exactly.

        Raises
        ------
        ThumperError
            It is mapping: there the first scan has laid the map's frame.
        """
        if self.localiser is None:
            raise ThumperError("a pose can be set in a saved map only: localise first", exit_code=EXIT_USAGE)
        self.localiser.place(map_from_base, odom_from_base=self._odometry)

    def relocalise(self) -> None:
        """Forget the pose and look for it in the whole map, at the next scan.

        Raises
        ------
        ThumperError
            It is mapping.
        """
        if self.localiser is None:
            raise ThumperError("the robot is mapping: localise first", exit_code=EXIT_USAGE)
        self.localiser.relocalise()

    def map_on(self) -> None:
        """Go on with mapping from the localised pose, in the map that was localised in.

        Raises
        ------
        ThumperError
            The localiser is lost, or a loaded map's cells are of another size than the mapper's.
        """
        localiser = self.localiser
        if localiser is None:
            return
        quality = localiser.quality()
        if quality.lost:
            raise ThumperError(f"mapping on from a wrong pose would spoil the map: {quality.lost}")
        if self._foreign is not None:
            options, fraction = self._mapping, self._mapping.occupied_fraction
            cells = HitGrid.of(self._foreign, options.resolution_m, options.reach_m, fraction)
            mapper = GridMapper(options, base_from_laser=self._base_from_laser)
            mapper.restart(cells, localiser.map_from_base)
            self._mapper, self._foreign = mapper, None
        self._mapper.continue_from(localiser.map_from_base, localiser.map_from_odom, quality.covariance)
        self.localiser, self._goes_on = None, False

    def update(self, odom_from_base: Pose2, scan: Scan, twist: Twist2) -> MapperUpdate:
        """Take one scan, as `Mapper.update`."""
        update = (self.localiser or self._mapper).update(odom_from_base, scan, twist)
        self._odometry, self._pose = odom_from_base, update.map_from_base
        if self._goes_on and self.localiser and self.localiser.proven and not self.quality().lost:
            self.map_on()
        return update

    def _start(self, grid: OccupancyGrid, map_from_base: Pose2 | None, *, by_hand: bool = True) -> None:
        if not np.any(grid.cells == OCCUPIED):
            raise ThumperError(
                "there is no wall in the map to know a place by; give another", exit_code=EXIT_USAGE
            )
        self.localiser = Amcl(
            grid,
            self._options,
            base_from_laser=self._base_from_laser,
            map_from_base=map_from_base,
            std_m=PLACED_STD_M,
            std_rad=PLACED_STD_RAD,
            odom_from_base=self._odometry,
            by_hand=by_hand,
        )
