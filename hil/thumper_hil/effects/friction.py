"""Grip and turning resistance of a six-wheeled skid-steered robot, from one coefficient of friction.

Every tyre carries a sixth of the weight and slides with Coulomb friction against the velocity of its contact
point. When the robot turns by its effective track, a middle wheel slides only along itself, a corner wheel
also sideways. The moment is the power of all six divided by the yaw rate. Martinez et al., "Approximating
Kinematics for Tracked Mobile Robots", IJRR 2005, use the same balance.
"""

import math
import tomllib
from functools import cache
from pathlib import Path

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper_hil.effects.body_parts import body_parts

GRAVITY_M_S2 = 9.81
WHEELS = body_parts().wheels
TOO_MUCH = frozenset({"deep_carpet"})
"""Floors on which some robots exceed the default current limit of 8 A when they turn on the spot."""


@cache
def floors() -> dict[str, float]:
    """Return the coefficient of friction of each floor."""
    text = Path(__file__).with_name("floors.toml").read_text(encoding="utf-8")
    return {name: float(value) for name, value in tomllib.loads(text).items()}


def floor_friction(name: str) -> float:
    """Return the coefficient of friction of a floor; raise ThumperError for an unknown one."""
    if name not in floors():
        raise ThumperError(
            f"unknown floor {name!r}; choose from {', '.join(sorted(floors()))}", exit_code=EXIT_USAGE
        )
    return floors()[name]


def scrub_moment_Nm(friction: float, mass_kg: float, effective_track_m: float) -> float:
    """Return the moment about the vertical that the sliding tyres oppose to a turn."""
    along_m = abs(0.5 * effective_track_m - WHEELS.half_track_m)
    slide_m = 4.0 * math.hypot(along_m, WHEELS.axle_m) + 2.0 * along_m  # slid per radian, all wheels
    return friction * mass_kg * GRAVITY_M_S2 / WHEELS.count * slide_m


def traction_Nm(friction: float, mass_kg: float, wheel_radius_m: float) -> float:
    """Return the torque at which the wheels of one side spin."""
    return friction * 0.5 * mass_kg * GRAVITY_M_S2 * wheel_radius_m
