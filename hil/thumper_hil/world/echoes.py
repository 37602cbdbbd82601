"""What beams meet in the world: range, kind of surface and angle of incidence."""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray
from thumper_hil.effects.surfaces import SurfaceArray


class Echoes(NamedTuple):
    """The surfaces that beams meet, all of shape (n,); range +inf for none."""

    range_m: FloatArray
    surface: SurfaceArray
    incidence_rad: FloatArray  # 0 along the normal

    def put(self, chosen: NDArray[np.bool_], part: "Echoes") -> None:
        """Replace the chosen beams, shape (n,), by those of `part`."""
        self.range_m[chosen] = part.range_m
        self.surface[chosen] = part.surface
        self.incidence_rad[chosen] = part.incidence_rad


class WorldAt(Protocol):
    """A world in which a lidar can measure at given times; times never decrease."""

    def cast_at(
        self, times_s: FloatArray, x_m: FloatArray, y_m: FloatArray, angles_rad: FloatArray
    ) -> FloatArray:
        """Return the distance [m] along each ray at its time, all shape (n,), +inf for none."""
        ...

    def echoes_at(
        self, times_s: FloatArray, x_m: FloatArray, y_m: FloatArray, angles_rad: FloatArray
    ) -> Echoes:
        """Return what each ray meets at its time; glass is passed by oblique rays."""
        ...
