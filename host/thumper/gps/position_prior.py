"""A position in the map that the GPS knows, and which poses contradict it."""

import math
from typing import NamedTuple

from thumper.common.geometry import Pose2
from thumper.common.texts import place_text

PRIOR_S = 3.0  # after which a position by GPS is too old
# A pose that a search finds farther from it is wrong: reflections shift a position by several standard
# deviations, and the map's datum, the antenna and the drive since then may be off, too.
PRIOR_SIGMAS, PRIOR_MARGIN_M = 5.0, 2.0


class PositionPrior(NamedTuple):
    """A position that a GPS knows."""

    x_m: float
    y_m: float
    std_m: float
    time_s: float  # of the measurement

    @property
    def radius_m(self) -> float:
        """Largest distance of a pose that does not contradict it [m]."""
        return PRIOR_SIGMAS * self.std_m + PRIOR_MARGIN_M

    def allows(self, pose: Pose2) -> bool:
        """Return whether the pose does not contradict it."""
        return math.hypot(pose.x_m - self.x_m, pose.y_m - self.y_m) <= self.radius_m

    @property
    def text(self) -> str:
        """Why a search that is limited to its surroundings found nothing."""
        return (
            f"the GPS is at {place_text(self.x_m, self.y_m)} in the map, and no place within "
            f"{self.radius_m:.0f} m of it fits the scan: drive to a part that is mapped with `thumper teleop`"
        )

    def log(self, pose: Pose2) -> float:
        """Return the logarithm of the likelihood of a pose, up to a constant."""
        sigmas = math.hypot(pose.x_m - self.x_m, pose.y_m - self.y_m) / self.std_m
        return -0.5 * sigmas**2


NO_PRIOR = PositionPrior(0.0, 0.0, math.inf, math.inf)
