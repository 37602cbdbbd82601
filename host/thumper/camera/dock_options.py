"""Options of the charging dock: the `[dock]` table of the robot's TOML."""

import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le

from thumper.common.geometry import Pose2


@dataclass(frozen=True, slots=True, kw_only=True)
class DockOptions:
    """The dock's tag, the pose of the docked robot, and how it gets there."""

    place: str = "dock"  # saved place of the docked robot; needed if the tag is not in view at the start
    tag: Annotated[int, Ge(0), Le(586)] = 0  # number in the family 36h11
    tag_size_m: Annotated[float, Gt(0)] = 0.10  # edge of the black square
    distance_m: Annotated[float, Gt(0)] = 0.45  # from the robot's origin to the tag when it is docked
    staging_m: Annotated[float, Ge(0.3)] = 0.70  # from there back to where the approach starts
    speed_m_s: Annotated[float, Gt(0), Le(0.2)] = 0.08  # of the approach
    retries: Annotated[int, Ge(0)] = 3  # after an approach that ended beside the dock
    low_battery_V: Annotated[float, Ge(0)] = 0.0  # below it for 5 s, a mission ends at dock or home; 0: never
    charger_V: Annotated[float, Ge(0)] = 0.0  # rise of the battery's voltage at the contacts; 0: not checked

    @property
    def tag_from_docked(self) -> Pose2:
        """The pose of the docked robot, which faces the tag."""
        return Pose2(x_m=self.distance_m, theta_rad=math.pi)
