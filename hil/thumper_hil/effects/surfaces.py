"""What a surface returns: matt, dark, shiny and glass surfaces under an angle of incidence.

Triangulating and time-of-flight lidars lose echoes of dark and shiny surfaces (Ye and Borenstein 2002; Kneip
et al. 2009, "Characterization of the compact Hokuyo URG-04LX"). Glass returns an echo only near its normal
and lets all other beams through (Foster et al. 2013, "VisAGGE: Visible Angle Grid for Glass Environments").
The probabilities are assumed.
"""

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from thumper.common.geometry import FloatArray


class Surface(IntEnum):
    """Kind of a surface."""

    MATT = 0
    DARK = 1
    SHINY = 2
    GLASS = 3


SurfaceArray = NDArray[np.int8]

GLASS_VISIBLE_RAD = math.radians(10.0)  # half of the angle about the normal in which glass returns an echo
SHINY_VISIBLE_RAD = math.radians(25.0)
SHINY_LOSS = 0.8  # beyond that angle: the beam leaves like from a mirror
DARK_LOSS = 0.1  # near the lidar
DARK_REACH = 0.55  # share of the lidar's range at which dark surfaces vanish: echoes of 5 % instead of 70 %


def echo_loss(
    surface: SurfaceArray, incidence_rad: FloatArray, range_m: FloatArray, range_max_m: float
) -> FloatArray:
    """Return the probability that each beam's echo is lost, shape (n,); matt surfaces lose none here."""
    dark = np.clip(DARK_LOSS + (1.0 - DARK_LOSS) * range_m / (DARK_REACH * range_max_m), 0.0, 1.0)
    shiny = np.where(incidence_rad > SHINY_VISIBLE_RAD, SHINY_LOSS, 0.0)
    return np.where(surface == Surface.DARK, dark, np.where(surface == Surface.SHINY, shiny, 0.0))
