"""The world a lidar sees during one revolution: static, or the recent states of a changing one."""

from collections import deque
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper_hil.world.echoes import Echoes
from thumper_hil.world.world import World

MAX_WORLDS = 32
"""One revolution of 0.1 s plus the reader's lag, at one world state per 10 ms."""


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
        ranges_m = np.empty(times_s.size)
        for world, own in self._nearest(times_s):
            ranges_m[own] = world.cast(x_m[own], y_m[own], angles_rad[own])
        return ranges_m

    def echoes_at(
        self, times_s: FloatArray, x_m: FloatArray, y_m: FloatArray, angles_rad: FloatArray
    ) -> Echoes:
        """See `WorldAt`."""
        found = Echoes(np.empty(times_s.size), np.empty(times_s.size, np.int8), np.empty(times_s.size))
        for world, own in self._nearest(times_s):
            found.put(own, world.echoes_at(times_s[own], x_m[own], y_m[own], angles_rad[own]))
        return found

    def _nearest(self, times_s: FloatArray) -> Iterator[tuple[World, NDArray[np.bool_]]]:
        """Yield each state that is nearest to some of the times, with the mask of these times."""
        known_s = np.array(self._times_s)
        nearest = np.searchsorted(0.5 * (known_s[1:] + known_s[:-1]), times_s, side="right")
        for index in np.unique(nearest):
            yield self._worlds[index], nearest == index
