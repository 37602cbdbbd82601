"""The goal of a drive to an object that the detector has seen."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.common.texts import place_text
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.filters import with_keepout
from thumper.navigation.footprint import Footprint
from thumper.navigation.navigator import Navigator
from thumper.navigation.planners.facing_pose import facing_pose
from thumper.runtime.object_map import ObjectMap
from thumper.runtime.state_estimator import StateEstimator


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectGoals:
    """Finds a free pose on the side of an object that the robot has seen."""

    objects: ObjectMap
    estimator: StateEstimator
    navigator: Navigator
    footprint: Footprint

    def content(self, label: str, content: Mapping[str, Any]) -> dict[str, Any]:
        """Return the goal in front of the nearest object of a class, as `parse_goal` takes it.

        `content` is the rest of the request.

        Raises
        ------
        ThumperError
            No such object has been seen, it has no free space before it, or there is another goal, too.
        """
        if set(content) - {"tolerance_m"}:
            raise ThumperError("a goal at an object has object and optionally tolerance_m")
        state = self.estimator.state()
        here = state.map_from_base if state else Pose2()
        found = self.objects.nearest(label, here)
        thing = Pose2(x_m=found.x_m, y_m=found.y_m, theta_rad=found.facing_rad)
        grid: OccupancyGrid = with_keepout(self.estimator.mapper.grid(), self.navigator.keepout)
        pose = facing_pose(thing, grid, state.hits_in_map_m, self.footprint) if state else None
        if pose is None:
            at = place_text(found.x_m, found.y_m)
            raise ThumperError(f"no free space before the {found.label} at {at}; choose a goal near it: X Y")
        return {**content, "x_m": pose.x_m, "y_m": pose.y_m, "yaw_rad": pose.theta_rad}
