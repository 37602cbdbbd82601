"""People who walk: discs on straight lines, and whose fault a contact is."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits
from thumper_hil.kinematic.world import KinematicWorld

RADIUS_M = 0.20
STANDING_M_S = 0.06  # what moves slower than this is walked into
CYCLE_S = 0.1  # between two poses of a drive's track


@dataclass(frozen=True, slots=True, kw_only=True)
class KinematicPedestrian:
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


def with_people(room: KinematicWorld, walkers: list[KinematicPedestrian], time_s: float) -> KinematicWorld:
    """The room with everybody where they are now."""
    discs = [[*walker.place_m(time_s), RADIUS_M] for walker in walkers]
    return KinematicWorld(segments_m=room.segments_m, circles_m=np.vstack((room.circles_m, discs)))


def contact(
    track: list[Pose2], walkers: list[KinematicPedestrian], time_s: float, limits: SpeedLimits
) -> str:
    """What a contact at the end of a drive was: "walked into", "caught from behind" or "drove into somebody".

    `track` holds the poses of all cycles until `time_s`. Who touches a robot that stands, or moves away, has
    walked into it. Who came into the lidar's view less than a stopping time ago came from behind.
    """
    place_m = (track[-1].x_m, track[-1].y_m)
    walker = min(walkers, key=lambda someone: math.dist(someone.place_m(time_s), place_m))
    if push_m_s(track[-2], track[-1], walker, time_s) < STANDING_M_S:
        return "walked into"
    stopping_s = limits.latency_s + limits.v_max_m_s / limits.v_accel_m_s2
    return "caught from behind" if seen_s(track, walker, time_s) < stopping_s else "drove into somebody"


def seen_s(track: list[Pose2], walker: KinematicPedestrian, time_s: float) -> float:
    """How long the lidar has had a walker in its view without a break, hidden by others or not [s].

    `track` holds the poses of all cycles until `time_s`.
    """
    view, cycles = FieldOfView(), 0
    for pose in reversed(track):
        bearing_rad, range_m = view.bearings_and_ranges(
            pose, walker.place_m(time_s - cycles * CYCLE_S)[None, :]
        )
        if not view.contains(bearing_rad, range_m, edge_rad=0.0)[0]:
            break
        cycles += 1
    return cycles * CYCLE_S


def push_m_s(before: Pose2, after: Pose2, walker: KinematicPedestrian, time_s: float) -> float:
    """Speed at which the nearest part of the hull moved toward a walker [m/s].

    `before` and `after` are a cycle apart, `after` at `time_s`. It is not above zero when the robot stood, or
    moved away and was caught up.
    """
    outline_m = Footprint().outline_m(0.01)
    points_m = after.apply(outline_m)
    away_m = walker.place_m(time_s) - points_m
    nearest = int(np.argmin(np.hypot(*away_m.T)))
    toward = away_m[nearest] / max(1e-9, math.hypot(*away_m[nearest]))
    return float(toward @ (points_m[nearest] - before.apply(outline_m)[nearest])) / CYCLE_S
