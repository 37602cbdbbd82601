"""People who walk: discs on straight lines, and whose fault a contact is."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.geometry import FloatArray
from thumper_hil.arena.world import World

RADIUS_M = 0.20


@dataclass(frozen=True, slots=True, kw_only=True)
class Walker:
    """To and fro between two places; a walker who waits stands at the first one before `from_s`."""

    a_m: tuple[float, float]
    b_m: tuple[float, float]
    speed_m_s: float = 1.0
    from_s: float = 0.0

    def place_m(self, time_s: float) -> FloatArray:
        """Where the walker is, shape (2,)."""
        length_m = math.dist(self.a_m, self.b_m)
        gone_m = max(0.0, time_s - self.from_s) * self.speed_m_s
        part = 1.0 - abs(1.0 - gone_m / max(length_m, 1e-9) % 2.0) if length_m > 0.0 else 0.0
        place_m: FloatArray = np.array(self.a_m) + part * (np.array(self.b_m) - np.array(self.a_m))
        return place_m


def with_people(room: World, walkers: list[Walker], time_s: float) -> World:
    """The room with everybody where they are now."""
    discs = [[*walker.place_m(time_s), RADIUS_M] for walker in walkers]
    return World(segments_m=room.segments_m, circles_m=np.vstack((room.circles_m, discs)))
