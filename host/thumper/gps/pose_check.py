"""Compares the pose in a loaded map with the GPS: a wrong start, a place that looks alike, a wrong map."""

import math

from thumper.common.geometry import Pose2
from thumper.common.texts import place_text
from thumper.gps.position_prior import PositionPrior

PATIENCE_S = 10.0  # a reflection or a false RTK fix passes


class GpsCheck:
    """Call `add` with each position by GPS; `finding` is one line for people, empty while the pose agrees."""

    def __init__(self) -> None:
        self.finding = ""
        self._since_s = math.inf

    def add(self, seen: PositionPrior, map_from_base: Pose2 | None) -> None:
        """Compare a position in the map with the pose at its time; None: the pose is lost."""
        if map_from_base is None or seen.allows(map_from_base):
            self._since_s = math.inf
            return
        self._since_s = min(self._since_s, seen.time_s)
        if seen.time_s - self._since_s >= PATIENCE_S:
            off_m = map_from_base.distance_m(Pose2(x_m=seen.x_m, y_m=seen.y_m))
            self.finding = (
                f"the GPS is at {place_text(seen.x_m, seen.y_m)} in the map, {off_m:.1f} m from the robot's "
                "pose: a wrong start, a wrong map or a wrong datum? `thumper mode search` looks again"
            )
