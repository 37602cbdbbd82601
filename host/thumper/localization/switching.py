"""Mapping and localisation behind one `Mapper`, to be switched while the robot runs."""

from thumper.geometry import Pose2, Twist2
from thumper.lidar.scan import Scan
from thumper.localization.amcl import Amcl, AmclOptions
from thumper.mapping.grid import OccupancyGrid
from thumper.mapping.grid_mapper import GridMapper
from thumper.mapping.mapper import MapperUpdate


class SwitchingMapper:
    """Maps until `localise` is called, then keeps the map as it is until `map_on`."""

    def __init__(
        self, mapper: GridMapper, options: AmclOptions | None = None, *, base_from_laser: Pose2 | None = None
    ) -> None:
        """Begin with mapping; `base_from_laser` must be the mapper's."""
        self._mapper, self._options = mapper, options
        self._base_from_laser = base_from_laser
        self.localiser: Amcl | None = None

    @property
    def map_from_odom(self) -> Pose2:
        """The correction that the newest scan led to."""
        return (self.localiser or self._mapper).map_from_odom

    def grid(self) -> OccupancyGrid:
        """The map (a copy while mapping, the frozen one while localising)."""
        return (self.localiser or self._mapper).grid()

    def localise(self) -> None:
        """Freeze the map and go on from the pose of the newest scan."""
        if self.localiser is None:
            self.localiser = Amcl(
                self._mapper.grid(),
                self._options,
                base_from_laser=self._base_from_laser,
                map_from_base=self._mapper.map_from_base,
            )

    def map_on(self) -> bool:
        """Go on with mapping from the localised pose; refused (False) while the localiser is lost."""
        localiser = self.localiser
        if localiser is None:
            return True
        if localiser.quality().lost:
            return False
        self._mapper.continue_from(localiser.map_from_base, localiser.map_from_odom)
        self.localiser = None
        return True

    def update(self, odom_from_base: Pose2, scan: Scan, twist: Twist2) -> MapperUpdate:
        """Take one scan, as `Mapper.update`."""
        return (self.localiser or self._mapper).update(odom_from_base, scan, twist)
