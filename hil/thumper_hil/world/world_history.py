"""The world a lidar sees during one revolution: static, or the recent states of a changing one."""

from collections import deque
from collections.abc import Callable
from typing import Protocol

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.world.world import World

MAX_WORLDS = 32
"""One revolution of 0.1 s plus the reader's lag, at one world state per 10 ms."""


class WorldAt(Protocol):
    """A world in which a lidar can measure at given times."""

    def cast_at(
        self, times_s: FloatArray, x_m: FloatArray, y_m: FloatArray, angles_rad: FloatArray
    ) -> FloatArray:
        """Return the distance [m] along each ray at its time, all shape (n,), +inf for none.

        Times never decrease.
        """
        ...


def cast_from_robot(
    world: WorldAt,
    pose_at: Callable[[FloatArray], FloatArray],
    base_from_laser: Pose2,
    times_s: FloatArray,
    bearings_rad: FloatArray,
) -> FloatArray:
    """Return the distance [m] along each beam, shape (n,), from the lidar's pose at the time of that beam.

    `pose_at(times_s)` returns map_from_base as rows (x_m, y_m, theta_rad), shape (n, 3). Beam angles are in
    the lidar's frame, counter-clockwise from its front.
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
    """The recent states of a changing world; each ray uses the state nearest in time."""

    def __init__(self, world: World, time_s: float = 0.0) -> None:
        self._worlds = deque([world], maxlen=MAX_WORLDS)
        self._times_s = deque([time_s], maxlen=MAX_WORLDS)

    def append(self, world: World, time_s: float) -> None:
        """Append the world's state from `time_s` on; times never decrease."""
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
