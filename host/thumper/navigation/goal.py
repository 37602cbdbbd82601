"""The pose that the robot is to reach, and the check of places that a user gives."""

import math
from dataclasses import dataclass

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2, wrap_angle
from thumper.common.texts import place_text

FARTHEST_M = 1000.0


def check_place(what: str, x_m: float, y_m: float) -> None:
    """Reject a place in `map` that is too far away; `what` names it.

    Raises
    ------
    ThumperError
        The place is farther than 1000 m from the map's origin, or not a number.
    """
    if not math.hypot(x_m, y_m) <= FARTHEST_M:
        raise ThumperError(
            f"{what} ({x_m:g}, {y_m:g}) is farther than {FARTHEST_M:g} m from the map's origin",
            exit_code=EXIT_USAGE,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """A position in `map`, with an optional heading."""

    x_m: float
    y_m: float
    theta_rad: float | None = None  # None: any heading
    tolerance_m: float = 0.10
    heading_tolerance_rad: float = 0.15

    def __post_init__(self) -> None:
        numbers = (self.x_m, self.y_m, 0.0 if self.theta_rad is None else self.theta_rad)
        if not all(map(math.isfinite, numbers)):
            raise ValueError(f"goal must be finite, got {self}")
        if not (self.tolerance_m > 0.0 and self.heading_tolerance_rad > 0.0):
            raise ValueError(f"goal tolerances must be positive, got {self}")

    def distance_m(self, map_from_base: Pose2) -> float:
        """Return the straight distance from the robot [m]."""
        return math.hypot(self.x_m - map_from_base.x_m, self.y_m - map_from_base.y_m)

    def heading_error_rad(self, map_from_base: Pose2) -> float:
        """Return the angle left to turn, counter-clockwise positive; 0 if the goal has no heading."""
        return 0.0 if self.theta_rad is None else wrap_angle(self.theta_rad - map_from_base.theta_rad)

    def __str__(self) -> str:
        return place_text(self.x_m, self.y_m)
