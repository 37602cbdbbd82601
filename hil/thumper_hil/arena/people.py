"""People who walk: discs on straight lines, and whose fault a contact is."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.geometry import FloatArray, Pose2
from thumper.navigation.footprint import Footprint
from thumper_hil.arena.world import World

RADIUS_M = 0.20
CYCLE_S = 0.1  # between two poses of a drive's track


@dataclass(frozen=True, slots=True, kw_only=True)
class Walker:
    """From one place to another, and to and fro if they return; they stand at the first before `from_s`."""

    a_m: tuple[float, float]
    b_m: tuple[float, float]
    speed_m_s: float = 1.0
    from_s: float = 0.0
    returns: bool = True

    def place_m(self, time_s: float) -> FloatArray:
        """Where the walker is, shape (2,)."""
        length_m = math.dist(self.a_m, self.b_m)
        gone_m = max(0.0, time_s - self.from_s) * self.speed_m_s
        lengths = gone_m / max(length_m, 1e-9)
        part = 1.0 - abs(1.0 - lengths % 2.0) if self.returns else min(1.0, lengths)
        place_m: FloatArray = np.array(self.a_m) + part * (np.array(self.b_m) - np.array(self.a_m))
        return place_m


def with_people(room: World, walkers: list[Walker], time_s: float) -> World:
    """The room with everybody where they are now."""
    discs = [[*walker.place_m(time_s), RADIUS_M] for walker in walkers]
    return World(segments_m=room.segments_m, circles_m=np.vstack((room.circles_m, discs)))


def push_m_s(before: Pose2, after: Pose2, walkers: list[Walker], time_s: float) -> float:
    """Speed at which the nearest part of the hull moved toward the nearest walker [m/s].

    `before` and `after` are a cycle apart, `after` at `time_s`. It is not above zero when the robot stood, or
    moved away and was caught up.
    """
    footprint = Footprint()
    outline_m = footprint.outline_m(0.01)
    places_m = np.array([walker.place_m(time_s) for walker in walkers])
    points_m, were_m = after.apply(outline_m), before.apply(outline_m)
    away_m = places_m[None, :, :] - points_m[:, None, :]
    point, walker = np.unravel_index(np.argmin(np.hypot(*away_m.T).T), away_m.shape[:2])
    toward = away_m[point, walker] / max(1e-9, math.hypot(*away_m[point, walker]))
    return float(toward @ (points_m[point] - were_m[point])) / CYCLE_S
