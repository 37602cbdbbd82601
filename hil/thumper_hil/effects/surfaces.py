"""What a surface returns: matt, dark, shiny and glass surfaces under an angle of incidence.

Triangulating and time-of-flight lidars lose echoes of dark and shiny surfaces (Ye and Borenstein 2002; Kneip
et al. 2009, "Characterization of the compact Hokuyo URG-04LX"). Glass returns an echo only near its normal
and lets all other beams through (Foster et al. 2013, "VisAGGE: Visible Angle Grid for Glass Environments").
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, with_config

from thumper.common.geometry import FloatArray
from thumper.common.strict_toml import STRICT, read_checked
from thumper_hil.effects.preset import Share


class Surface(IntEnum):
    """Kind of a surface."""

    MATT = 0
    DARK = 1
    SHINY = 2
    GLASS = 3


SurfaceArray = NDArray[np.int8]


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class Returns:
    """What surfaces return, read from `surfaces.toml`; angles are from the surface's normal."""

    glass_visible_deg: float
    shiny_visible_deg: float
    shiny_loss: Share
    dark_loss: Share
    dark_reach: Share


RETURNS = read_checked(Path(__file__).with_name("surfaces.toml"), TypeAdapter(Returns), Returns, "surfaces")
GLASS_VISIBLE_RAD = math.radians(RETURNS.glass_visible_deg)
SHINY_VISIBLE_RAD = math.radians(RETURNS.shiny_visible_deg)


def echo_loss(
    surface: SurfaceArray, incidence_rad: FloatArray, range_m: FloatArray, range_max_m: float
) -> FloatArray:
    """Return the probability that each beam's echo is lost, shape (n,); matt surfaces lose none here."""
    near = RETURNS.dark_loss
    dark = np.clip(near + (1.0 - near) * range_m / (RETURNS.dark_reach * range_max_m), 0.0, 1.0)
    shiny = np.where(incidence_rad > SHINY_VISIBLE_RAD, RETURNS.shiny_loss, 0.0)
    return np.where(surface == Surface.DARK, dark, np.where(surface == Surface.SHINY, shiny, 0.0))
