"""What surrounds a lidar during a turn: a world that stands still, or the last tenths of one that changes."""

from collections import deque
from collections.abc import Callable
from typing import Protocol

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.world.world import World

REMEMBERED = 32
"""Worlds: a turn of 0.1 s and what a reader lags behind, at one world each 10 ms."""


class WorldAt(Protocol):
    """What a lidar looks into."""

    def cast_at(
        self, times_s: FloatArray, x_m: FloatArray, y_m: FloatArray, angles_rad: FloatArray
    ) -> FloatArray:
        """Distance [m] along each ray at its own time, all shape (n,), +inf for none; times never go back."""
        ...


def cast_from_robot(
    world: WorldAt,
    pose_at: Callable[[FloatArray], FloatArray],
    base_from_laser: Pose2,
    times_s: FloatArray,
    bearings_rad: FloatArray,
) -> FloatArray:
    """Distance [m] along each beam, shape (n,), from where the robot has its lidar at that beam's own time.

    `pose_at(times_s)` returns map_from_base as rows (x_m, y_m, theta_rad), shape (n, 3); bearings are the
    laser's own, counter-clockwise from its front.
    """
    poses, mount = pose_at(times_s), base_from_laser
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return world.cast_at(
        times_s,
        poses[:, 0] + cos * mount.x_m - sin * mount.y_m,
        poses[:, 1] + sin * mount.x_m + cos * mount.y_m,
        poses[:, 2] + mount.theta_rad + bearings_rad,
    )


class WorldHistory:
    """A world that changes: each ray meets the one whose time is nearest to its own."""

    def __init__(self, world: World, time_s: float = 0.0) -> None:
        self._worlds = deque([world], maxlen=REMEMBERED)
        self._times_s = deque([time_s], maxlen=REMEMBERED)

    def change(self, world: World, time_s: float) -> None:
        """The world is this from now on; `time_s` never goes back."""
        self._worlds.append(world)
        self._times_s.append(time_s)

    def cast_at(
        self, times_s: FloatArray, x_m: FloatArray, y_m: FloatArray, angles_rad: FloatArray
    ) -> FloatArray:
        """See `WorldAt`."""
        known_s = np.array(self._times_s)
        nearest = np.searchsorted(0.5 * (known_s[1:] + known_s[:-1]), times_s, side="right")
        ranges_m = np.empty(times_s.size)
        for index in np.unique(nearest):
            own = nearest == index
            ranges_m[own] = self._worlds[index].cast(x_m[own], y_m[own], angles_rad[own])
        return ranges_m
