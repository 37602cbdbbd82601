"""Switch between mapping and localization while the robot runs."""

import math

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.resumable import SlicedSearch, merged
from thumper.gps.position_prior import PositionPrior
from thumper.lidar.scan import Scan
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from thumper.slam.factory import PathMapper
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.grid.options import GridMapperOptions
from thumper.slam.localization.amcl import Amcl
from thumper.slam.localization.likelihood_field import LikelihoodField
from thumper.slam.localization.options import AmclOptions
from thumper.slam.mapper import DetectsKidnapping, HasParticles, MapperUpdate, PoseQuality

# Standard deviations of the pose that the mapper passes to the localizer.
HANDOVER_STD_M, HANDOVER_STD_RAD = 0.1, 0.05
LOCALIZE_FIRST = "localize first, with `thumper mode localize`"
BANDS_PER_SCAN = 3  # of a map that is prepared for the search of a kidnapped robot: about 10 ms


class SlamModeSwitch:
    """A `Mapper` that maps until it is switched to localization, and back.

    The pose never jumps at a switch: the new estimator starts at the old one's pose at the newest scan. Only
    for a robot that was kidnapped while mapping does it search the whole map.
    """

    def __init__(
        self,
        mapper: PathMapper,
        mapping: GridMapperOptions | None = None,
        options: AmclOptions | None = None,
        *,
        base_from_laser: Pose2 | None = None,
    ) -> None:
        """Start in mapping mode; `mapping` and `base_from_laser` must be the mapper's own."""
        self._mapper, self._mapping = mapper, mapping or GridMapperOptions()
        self._options = options or AmclOptions()
        self._base_from_laser = base_from_laser
        self._odom_from_base: Pose2 | None = None  # at the newest scan
        self._map_from_base: Pose2 | None = None  # at the newest scan
        self._loaded: HitCounts | None = None  # the map in use, if it is not the mapper's own
        self._continued: HitGrid | None = None  # made from `_loaded` before the robot moves
        self._resume_when_confirmed = False
        self._preparation = SlicedSearch[LikelihoodField]()
        self.localizer: Amcl | None = None

    @property
    def map_from_odom(self) -> Pose2:
        """The correction at the newest scan."""
        return (self.localizer or self._mapper).map_from_odom

    def grid(self) -> OccupancyGrid:
        """Return the current map, which is fixed during localization."""
        return (self.localizer or self._mapper).grid()

    def counts(self) -> HitCounts:
        """Return the hit counts of the map that `grid` returns, to resume mapping later."""
        return self._mapper.counts() if self._loaded is None else self._loaded

    def quality(self) -> PoseQuality:
        """Return the covariance of the newest pose and whether it is lost."""
        return (self.localizer or self._mapper).quality()

    @property
    def mode(self) -> str:
        """What it does now, as text for the user."""
        if self.localizer is None:
            return "mapping"
        if self._resume_when_confirmed:
            return "localizing, resumes mapping after localization"
        return "localizing"

    @property
    def is_localizing(self) -> bool:
        """Whether the map is fixed and only the pose is estimated."""
        return self.localizer is not None

    @property
    def map_doubt(self) -> str:
        """Why the localization map may be the wrong one; empty while it fits, and while mapping."""
        return self.localizer.map_doubt if self.localizer else ""

    @property
    def particle_poses(self) -> FloatArray | None:
        """x, y, theta of each particle, shape (n, 3); None if the active method has no particles."""
        active = self.localizer or self._mapper
        return active.particle_poses if isinstance(active, HasParticles) else None

    def path(self) -> FloatArray:
        """Return x, y, theta at each mapped scan, shape (scans, 3)."""
        return self._mapper.path()

    def warm_up(self) -> None:
        """Compile the kernels of mapper and localizer, or load them from the cache."""
        self._mapper.warm_up()
        cells = np.full((40, 40), UNKNOWN, dtype=np.int8)
        cells[1:-1, 1:-1] = FREE
        cells[1:-1, 1] = OCCUPIED
        small = OccupancyGrid(cells=cells, resolution_m=0.1, origin_x_m=-2.0, origin_y_m=-2.0)
        Amcl(small, self._options).warm_up()

    def localize(self) -> None:
        """Freeze the current map and continue from the pose of the newest scan.

        Raises
        ------
        ThumperError
            Nothing has been mapped yet.
        """
        self._resume_when_confirmed = False
        if self.localizer is None:
            self._start_localizer(self._mapper.grid(), self._map_from_base or Pose2(), verify=False)

    def localize_in(self, grid: OccupancyGrid, map_from_base: Pose2 | None) -> None:
        """Localize in a saved map, from a given pose or, with None, anywhere in it.

        Raises
        ------
        ThumperError
            The map has no occupied cell.
        """
        self._start_localizer(grid, map_from_base)
        self._loaded, self._continued = HitCounts.from_grid(grid), None
        self._resume_when_confirmed = False

    def resume_from(self, counts: HitCounts, map_from_base: Pose2 | None) -> None:
        """Resume mapping in a saved map, as soon as the robot's pose in it is confirmed.

        Until then it localizes in that map, from a given pose or, with None, anywhere in it.

        Raises
        ------
        ThumperError
            The map has no occupied cell, or another resolution than the mapper.
        """
        self._start_localizer(counts.grid(self._mapping.occupied_fraction), map_from_base)
        self._loaded, self._continued = counts, self._grid_from(counts)
        self._resume_when_confirmed = True

    def set_pose(self, map_from_base: Pose2) -> None:
        """Restart localization at an approximate pose; the next scan refines it.

        Raises
        ------
        ThumperError
            It is mapping: then the first scan has fixed the map frame.
        """
        if self.localizer is None:
            raise ThumperError(
                "the robot is mapping; load a saved map (page: tab Map), or run `thumper mode localize`",
                exit_code=EXIT_USAGE,
            )
        self.localizer.set_pose(map_from_base, odom_from_base=self._odom_from_base)

    def set_position_prior(self, prior: PositionPrior) -> None:
        """Expect the robot near this position in a loaded map, when the whole map is searched."""
        if self.localizer is not None:
            self.localizer.set_position_prior(prior)

    def relocalize(self) -> None:
        """Discard the pose and search the whole map for it at the next scan.

        Raises
        ------
        ThumperError
            It is mapping.
        """
        if self.localizer is None:
            raise ThumperError(f"the robot is mapping: {LOCALIZE_FIRST}", exit_code=EXIT_USAGE)
        self.localizer.relocalize()

    def resume_mapping(self) -> None:
        """Continue mapping from the localized pose, in the map used for localization.

        Raises
        ------
        ThumperError
            The pose is lost, or the loaded map has another resolution than the mapper.
        """
        localizer = self.localizer
        if localizer is None:
            return
        quality = localizer.quality()
        if quality.lost:
            raise ThumperError(f"mapping from a wrong pose would spoil the map: {quality.lost}")
        if self._loaded is not None:
            mapper = GridMapper(self._mapping, base_from_laser=self._base_from_laser)
            mapper.replace_map(self._continued or self._grid_from(self._loaded), localizer.map_from_base)
            self._mapper, self._loaded, self._continued = mapper, None, None
        self._mapper.resume_at(localizer.map_from_base, localizer.map_from_odom, quality.covariance)
        self.localizer, self._resume_when_confirmed = None, False

    def update(
        self, odom_from_base: Pose2, scan: Scan, twist: Twist2, *, turn_std_rad: float = math.inf
    ) -> MapperUpdate:
        """Process one scan; see `Mapper.update`."""
        active = self.localizer or self._mapper
        update = active.update(odom_from_base, scan, twist, turn_std_rad=turn_std_rad)
        self._odom_from_base, self._map_from_base = odom_from_base, update.map_from_base
        if self.localizer is None and (field := self._own_map_after_kidnapping()) is not None:
            # Search the own map, and continue in it once the scans confirm a place.
            self._start_localizer(field, None).set_likely_pose(self._mapper.map_from_odom)
            self._resume_when_confirmed = True
        confirmed = self.localizer is not None and self.localizer.confirmed
        if self._resume_when_confirmed and confirmed and not self.quality().lost:
            self.resume_mapping()
        return update

    def _grid_from(self, counts: HitCounts) -> HitGrid:
        options = self._mapping
        return HitGrid.from_counts(counts, options.resolution_m, options.reach_m, options.occupied_fraction)

    def _own_map_after_kidnapping(self) -> LikelihoodField | None:
        """Return the mapper's map prepared for localization, some scans after a kidnapping."""
        if not (isinstance(self._mapper, DetectsKidnapping) and self._mapper.kidnapped):
            self._preparation.stop()
            return None
        if not self._preparation.is_running:
            self._preparation.start(merged(LikelihoodField.search(self._mapper.grid()), BANDS_PER_SCAN))
        return self._preparation.advance()

    def _start_localizer(
        self, known: OccupancyGrid | LikelihoodField, map_from_base: Pose2 | None, *, verify: bool = True
    ) -> Amcl:
        self._preparation.stop()
        grid = known.grid if isinstance(known, LikelihoodField) else known
        if not np.any(grid.cells == OCCUPIED):
            raise ThumperError(
                "the map has no walls, so the robot cannot localize in it; choose another map",
                exit_code=EXIT_USAGE,
            )
        self.localizer = Amcl(
            known,
            self._options,
            base_from_laser=self._base_from_laser,
            map_from_base=map_from_base,
            std_m=HANDOVER_STD_M,
            std_rad=HANDOVER_STD_RAD,
            odom_from_base=self._odom_from_base,
            verify=verify,
        )
        return self.localizer
