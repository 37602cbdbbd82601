"""Walking people as discs on straight lines, and a rule for who causes a contact."""

import math
from dataclasses import dataclass

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.lidar.field_of_view import FieldOfView
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits
from thumper_hil.kinematic.world import KinematicWorld

RADIUS_M = 0.20
STATIONARY_M_S = 0.06  # below this approach speed, the person walked into the robot
CYCLE_S = 0.1  # between two poses of a drive's track


@dataclass(frozen=True, slots=True, kw_only=True)
class KinematicPedestrian:
    """A person who waits at `a_m` until `from_s`, walks to `b_m` and, with `returns`, back and forth."""

    a_m: tuple[float, float]
    b_m: tuple[float, float]
    speed_m_s: float = 1.0
    from_s: float = 0.0
    returns: bool = True

    def position_m(self, time_s: float) -> FloatArray:
        """Return the person's position, shape (2,)."""
        length_m = math.dist(self.a_m, self.b_m)
        gone_m = max(0.0, time_s - self.from_s) * self.speed_m_s
        lengths = gone_m / max(length_m, 1e-9)
        part = 1.0 - abs(1.0 - lengths % 2.0) if self.returns else min(1.0, lengths)
        point_m: FloatArray = np.array(self.a_m) + part * (np.array(self.b_m) - np.array(self.a_m))
        return point_m


def with_people(room: KinematicWorld, walkers: list[KinematicPedestrian], time_s: float) -> KinematicWorld:
    """Return the room with all people at their current positions."""
    discs = [[*walker.position_m(time_s), RADIUS_M] for walker in walkers]
    return KinematicWorld(segments_m=room.segments_m, circles_m=np.vstack((room.circles_m, discs)))


def classify_contact(
    track: list[Pose2], walkers: list[KinematicPedestrian], time_s: float, limits: SpeedLimits
) -> str:
    """Return the cause of a contact: "walked into", "caught from behind" or "drove into a person".

    `track` holds the poses of all cycles until `time_s`. A person who touches a stationary or receding robot
    walked into it. A person who was in the lidar's view for less than the stopping time came from behind.
    """
    robot_m = (track[-1].x_m, track[-1].y_m)
    walker = min(walkers, key=lambda person: math.dist(person.position_m(time_s), robot_m))
    if approach_speed_m_s(track[-2], track[-1], walker, time_s) < STATIONARY_M_S:
        return "walked into"
    stopping_s = limits.latency_s + limits.v_max_m_s / limits.v_accel_m_s2
    return "caught from behind" if visible_s(track, walker, time_s) < stopping_s else "drove into a person"


def visible_s(track: list[Pose2], walker: KinematicPedestrian, time_s: float) -> float:
    """Return how long a person has been in the lidar's field of view without a break, occluded or not [s].

    `track` holds the poses of all cycles until `time_s`.
    """
    view, cycles = FieldOfView(), 0
    for pose in reversed(track):
        bearing_rad, range_m = view.bearings_and_ranges(
            pose, walker.position_m(time_s - cycles * CYCLE_S)[None, :]
        )
        if not view.contains(bearing_rad, range_m, edge_rad=0.0)[0]:
            break
        cycles += 1
    return cycles * CYCLE_S


def approach_speed_m_s(before: Pose2, after: Pose2, walker: KinematicPedestrian, time_s: float) -> float:
    """Return the speed at which the nearest part of the footprint moved toward a person [m/s].

    `before` and `after` are one cycle apart, with `after` at `time_s`. The speed is zero or negative if the
    robot was stationary or moved away.
    """
    outline_m = Footprint().outline_m(0.01)
    points_m = after.apply(outline_m)
    away_m = walker.position_m(time_s) - points_m
    nearest = int(np.argmin(np.hypot(*away_m.T)))
    toward = away_m[nearest] / max(1e-9, math.hypot(*away_m[nearest]))
    return float(toward @ (points_m[nearest] - before.apply(outline_m)[nearest])) / CYCLE_S
