"""Tracks of people and other dynamic obstacles: where each is, how it moves, and where it may be soon.

A track begins where `DynamicObstacles` finds something that moves. An alpha-beta filter follows the small
objects near it in each scan, also while they stand for a moment or turn round. Both legs of a person are one
track: one rests while the other swings.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray, Pose2
from thumper.common.numba_kernel import kernel
from thumper.navigation.costmap.costmap import Costmap
from thumper.navigation.safety.dynamic_obstacles import MovingObject, SmallObject

# Gains of position and velocity per scan: for somebody who walks straight, and for somebody who turns.
STEADY_GAINS, TURNING_GAINS = (0.35, 0.10), (0.6, 0.30)
TURNING_ERROR_M = 0.12  # a mean error that the swing of the legs does not explain
MEAN_GAIN = 0.35
GATE_M = 0.65  # an object further from the predicted place is not a part of this track
REST_GATE_M = 0.3  # the same for an object that may be a part of a wall
NEW_GATE_M = 0.8  # a foot that moves is part of a track that is nearer than this
PART_M = 0.5  # a foot that moves is a part of a moving track that is nearer than this
MOST_ERROR_M = 0.35  # of it counts
FOOT_FRACTION = 0.6  # a foot swings at about twice the speed of who walks
RADIUS_DECAY = 0.9  # per scan: a part of somebody may be hidden
HIDDEN_S = 1.0  # a track without an object ends after this time, ...
STANDS_S = 5.0  # ... and that of somebody who stands
STANDING_S = 1.5  # somebody who stands for less may turn round
UNKNOWN_S, NEAR_ROBOT_M = 0.25, 1.0  # how somebody walks who has just come into view so near is not known yet
TURNING_FRACTION = 0.7  # slower than this part of the speed that it had: it may turn round
MERGE_M = 0.4  # two tracks this near are one
LEAST_RADIUS_M, MOST_RADIUS_M = 0.12, 0.40
WALKING_M = 0.55  # round the middle of who walks: points here are on them, unless they rest
CIRCLE = np.column_stack([f(np.radians(np.arange(0.0, 360.0, 45.0))) for f in (np.cos, np.sin)])
STRIDE_M = 0.15  # two discs, one ahead of the other, cover both legs
AGE_S = 0.1  # of the scan when the command reaches the wheels
BEHIND_FRACTION = 0.6  # the lidar sees the near side: the middle is further off by this part of the radius
FASTEST_M_S = 1.6
WALL_M = 0.05  # room that somebody keeps to a wall
NEAR_M = 0.4  # an obstacle nearer to the track than this now is no wall in its way
EARLY_STEPS = 3  # somebody may turn so much sooner than at a wall
SURE_STEPS = 30  # what somebody does at a wall is of interest if it is reached sooner
STEP_S, STEPS = 0.1, 50  # of the predictions


@dataclass(slots=True, kw_only=True)
class Track:
    """A dynamic obstacle: two discs of this radius, a stride apart."""

    centre_m: FloatArray  # shape (2,), in map
    velocity_m_s: FloatArray  # shape (2,)
    radius_m: float
    begun_s: float
    seen_s: float
    moved_s: float  # when it was faster than `least_m_s` last ...
    walk_m_s: FloatArray  # ... and its velocity then
    mean_error_m: FloatArray = field(default_factory=lambda: np.zeros(2))  # of the predictions, lately

    @property
    def speed_m_s(self) -> float:
        """Return the speed."""
        return math.hypot(*self.velocity_m_s)

    @property
    def stride_m(self) -> FloatArray:
        """Return the vector from the middle to the disc of the foremost leg, shape (2,)."""
        return STRIDE_M * _unit(self.walk_m_s)


class Tracks:
    """Follows dynamic obstacles from scan to scan."""

    def __init__(self, least_m_s: float) -> None:
        """Slower objects than `least_m_s` count as static."""
        self._least_m_s = least_m_s
        self._time_s: float | None = None
        self.tracks: list[Track] = []
        self.untracked: list[MovingObject] = []  # those of the newest scan that are a part of no moving track

    def move(self, new_from_old: Pose2) -> None:
        """Move all tracks in the map."""
        turn = Pose2(theta_rad=new_from_old.theta_rad)
        for track in self.tracks:
            track.centre_m = new_from_old.apply(track.centre_m)
            track.velocity_m_s, track.walk_m_s = turn.apply(track.velocity_m_s), turn.apply(track.walk_m_s)
            track.mean_error_m = turn.apply(track.mean_error_m)

    def update(
        self, time_s: float, lidar: Pose2, objects: list[SmallObject], moving: list[MovingObject]
    ) -> None:
        """Follow all tracks to a scan's small objects; begin those of new moving ones."""
        elapsed_s = 0.0 if self._time_s is None else time_s - self._time_s
        self._time_s = time_s
        discs = _discs([points_m for points_m, _ in objects], lidar)
        rests = np.array([at_rest for _, at_rest in objects], np.bool_)
        if elapsed_s > HIDDEN_S:  # the robot has not looked: what is there now may be something else
            self.tracks = []
        for track in self.tracks:
            track.centre_m = track.centre_m + track.velocity_m_s * elapsed_s
        centres_m = np.array([track.centre_m for track in self.tracks]).reshape(-1, 2)
        distances_m = np.hypot(*(discs[:, None, :2] - centres_m).transpose(2, 0, 1))
        for number, track in enumerate(self.tracks):
            mine = (distances_m[:, number] <= GATE_M) & (distances_m[:, number] == distances_m.min(axis=1))
            if (mine & ~rests).any():
                mine &= ~rests
            else:
                mine &= distances_m[:, number] <= REST_GATE_M
            if mine.any():
                self._follow(track, discs[mine], time_s, elapsed_s)
        self.tracks = [track for track in self.tracks if self._is_kept(track, time_s)]
        self._merge()
        found = list(zip(moving, _discs([moved.points_m for moved in moving], lidar), strict=True))
        for moved, (x_m, y_m, radius_m) in found:
            if all(math.dist((x_m, y_m), track.centre_m) > NEW_GATE_M for track in self.tracks):
                velocity_m_s = _limited(FOOT_FRACTION * moved.velocity_m_s)
                self.tracks.append(
                    Track(
                        centre_m=np.array((x_m, y_m)),
                        velocity_m_s=velocity_m_s,
                        radius_m=radius_m,
                        begun_s=time_s,
                        seen_s=time_s,
                        moved_s=time_s,
                        walk_m_s=velocity_m_s,
                    )
                )
        walking = self.moving()
        self.untracked = [
            moved
            for moved, (x_m, y_m, _) in found
            if all(math.dist((x_m, y_m), track.centre_m) > PART_M for track in walking)
        ]

    def _merge(self) -> None:
        """Keep the older of two tracks at one place."""
        kept: list[Track] = []
        for track in self.tracks:
            if all(math.dist(track.centre_m, other.centre_m) > MERGE_M for other in kept):
                kept.append(track)
        self.tracks = kept

    def moving(self) -> list[Track]:
        """Return the tracks that move, or stopped only a moment ago."""
        return [track for track in self.tracks if track.speed_m_s >= self._least_m_s or self._turns(track)]

    def outlines(self) -> list[MovingObject]:
        """Return points round both discs of each track that moves now, with the velocity of the track."""
        return [
            MovingObject(
                track.centre_m
                + np.vstack([end * track.stride_m + track.radius_m * CIRCLE for end in (-1.0, 1.0)]),
                track.velocity_m_s,
            )
            for track in self._moving_now()
        ]

    def feet_m(self) -> FloatArray:
        """Return the middle and both ends of the stride of each track that moves now, shape (n, 2) in map."""
        feet_m = [
            track.centre_m + end * track.stride_m for track in self._moving_now() for end in (-1.0, 0.0, 1.0)
        ]
        return np.array(feet_m).reshape(-1, 2)

    def are_near(self, points_m: FloatArray) -> NDArray[np.bool_]:
        """Return which points, shape (n, 2) in map, are near the middle of a track that moves now."""
        near = np.zeros(len(points_m), np.bool_)
        for track in self._moving_now():
            near |= np.hypot(*(points_m - track.centre_m).T) <= WALKING_M
        return near

    def has_unknown_near(self, at_m: FloatArray) -> bool:
        """Return whether somebody has just come into view near a place, shape (2,) in map.

        One foot of theirs has been seen moving. It may have just risen, or swing back.
        """
        return self._time_s is not None and any(
            self._time_s - track.begun_s < UNKNOWN_S and math.dist(at_m, track.centre_m) < NEAR_ROBOT_M
            for track in self.tracks
        )

    def predicted(self, costmap: Costmap) -> FloatArray:
        """Return the discs (x, y, radius) of all times and hypotheses, shape (STEPS, n, 3).

        Who walks goes on straight. If an obstacle is in the way, one hypothesis is to stop there, others are
        to turn round there or somewhat earlier. Who has just stopped may stay, turn round or go on.
        """
        found = [
            np.column_stack((places_m + end * track.stride_m, np.full(STEPS, track.radius_m)))
            for track in self.moving()
            for places_m in self._hypotheses(track, costmap)
            for end in (-1.0, 1.0)
        ]
        return np.ascontiguousarray(np.array(found).reshape(-1, STEPS, 3).transpose(1, 0, 2))

    def _hypotheses(self, track: Track, costmap: Costmap) -> list[FloatArray]:
        if track.speed_m_s < TURNING_FRACTION * math.hypot(*track.walk_m_s):
            return [
                _places_m(track, velocity_m_s, costmap, turns=False)
                for velocity_m_s in (np.zeros(2), -track.walk_m_s, track.walk_m_s)
            ]
        stops, turns = (_places_m(track, track.velocity_m_s, costmap, turns=turns) for turns in (False, True))
        if np.array_equal(stops[:SURE_STEPS], turns[:SURE_STEPS]):
            return [stops]
        early = _places_m(track, track.velocity_m_s, costmap, turns=True, earlier=EARLY_STEPS)
        return [stops, turns, early]

    def _follow(self, track: Track, discs: FloatArray, time_s: float, elapsed_s: float) -> None:
        error_m = discs[:, :2].mean(axis=0) - track.centre_m
        error_m *= min(1.0, MOST_ERROR_M / max(1e-9, math.hypot(*error_m)))
        track.mean_error_m = track.mean_error_m + MEAN_GAIN * (error_m - track.mean_error_m)
        turns = math.hypot(*track.mean_error_m) > TURNING_ERROR_M
        position_gain, velocity_gain = TURNING_GAINS if turns else STEADY_GAINS
        track.centre_m = track.centre_m + position_gain * error_m
        track.velocity_m_s = _limited(track.velocity_m_s + velocity_gain * error_m / max(elapsed_s, 0.05))
        radius_m = min(_reach_across_m(discs, track), MOST_RADIUS_M)
        track.radius_m = max(radius_m, RADIUS_DECAY * track.radius_m)
        track.seen_s = time_s
        if track.speed_m_s >= self._least_m_s:
            track.moved_s = time_s
            if track.speed_m_s >= TURNING_FRACTION * math.hypot(*track.walk_m_s):
                track.walk_m_s = track.velocity_m_s

    def _moving_now(self) -> list[Track]:
        return [track for track in self.tracks if track.speed_m_s >= self._least_m_s]

    def _turns(self, track: Track) -> bool:
        return self._time_s is not None and self._time_s - track.moved_s < STANDING_S

    @staticmethod
    def _is_kept(track: Track, time_s: float) -> bool:
        return time_s - track.seen_s <= HIDDEN_S and time_s - track.moved_s <= STANDS_S


def _unit(vector: FloatArray) -> FloatArray:
    """Return a vector of length 1 in the direction of another, shape (2,)."""
    return vector / max(1e-9, math.hypot(*vector))


def _limited(velocity_m_s: FloatArray) -> FloatArray:
    speed_m_s = math.hypot(*velocity_m_s)
    return velocity_m_s * min(1.0, FASTEST_M_S / max(speed_m_s, 1e-9))


def _discs(objects_m: list[FloatArray], lidar: Pose2) -> FloatArray:
    """Return the disc (x, y, radius) of which the lidar sees each object's points, shape (k, 3)."""
    ends = np.cumsum([len(points_m) for points_m in objects_m], dtype=np.int64)
    return _fit_discs(np.vstack((np.empty((0, 2)), *objects_m)), ends, lidar.x_m, lidar.y_m)


@kernel
def _fit_discs(
    points_m: FloatArray, ends: NDArray[np.int64], lidar_x_m: float, lidar_y_m: float
) -> FloatArray:
    """`points_m`, shape (n, 2), are those of all objects; the points of object k end at `ends[k]`."""
    discs = np.empty((len(ends), 3))
    start = 0
    for k in range(len(ends)):
        mine = points_m[start : ends[k]]
        start = ends[k]
        x_m, y_m = mine[:, 0].mean(), mine[:, 1].mean()
        distance_m = max(1e-9, math.hypot(x_m - lidar_x_m, y_m - lidar_y_m))
        away_x, away_y = (x_m - lidar_x_m) / distance_m, (y_m - lidar_y_m) / distance_m
        across_m = mine[:, 1] * away_x - mine[:, 0] * away_y
        radius_m = max(LEAST_RADIUS_M, 0.5 * (across_m.max() - across_m.min()))
        discs[k, 0] = x_m + BEHIND_FRACTION * radius_m * away_x
        discs[k, 1] = y_m + BEHIND_FRACTION * radius_m * away_y
        discs[k, 2] = min(radius_m, MOST_RADIUS_M)
    return discs


def _reach_across_m(discs: FloatArray, track: Track) -> float:
    """Return how far discs (x, y, radius), shape (n, 3), reach to a side of where somebody walks."""
    along = _unit(track.walk_m_s)
    offset_m = discs[:, :2] - track.centre_m
    return float((np.abs(offset_m @ (-along[1], along[0])) + discs[:, 2]).max())


def _places_m(
    track: Track, velocity_m_s: FloatArray, costmap: Costmap, *, turns: bool, earlier: int = 0
) -> FloatArray:
    """Return the places at STEP_S, 2 STEP_S, ... at a velocity, shape (STEPS, 2), up to a wall or back.

    `earlier` are the steps by which it ends or turns before the wall.
    """
    places_m = track.centre_m + velocity_m_s * (AGE_S + STEP_S * np.arange(1, STEPS + 1))[:, None]
    rows, cols = costmap.cells_of(places_m)
    inside = (rows >= 0) & (cols >= 0) & (rows < costmap.costs.shape[0]) & (cols < costmap.costs.shape[1])
    least_cells = (track.radius_m + WALL_M) / costmap.resolution_m
    is_wall = np.zeros(STEPS, np.bool_)
    is_wall[inside] = costmap.squared_cells[rows[inside], cols[inside]] < least_cells**2
    is_wall &= np.hypot(*(places_m - track.centre_m).T) > NEAR_M
    walls = np.flatnonzero(is_wall)
    if walls.size:
        last = max(0, int(walls[0]) - 1 - earlier)
        count = STEPS - 1 - last
        after = last - np.arange(1, count + 1) if turns else np.full(count, last)
        back_m = places_m[np.clip(after, 0, STEPS - 1)]
        over = after < 0  # back past where it is now
        back_m[over] = track.centre_m + velocity_m_s * (AGE_S + STEP_S * (after[over] + 1))[:, None]
        places_m[last + 1 :] = back_m
    return places_m
