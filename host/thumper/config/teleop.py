"""Options of joysticks and keys: the `[teleop]` table of the robot's TOML."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le, Lt


@dataclass(frozen=True, slots=True, kw_only=True)
class TeleopOptions:
    """How stick and key positions become speeds."""

    # Speed at full stick deflection [m/s].
    v_max_m_s: Annotated[float, Gt(0), Le(1.0)] = 0.35
    # Turning speed at full stick deflection [rad/s].
    w_max_rad_s: Annotated[float, Gt(0), Le(6.0)] = 1.2
    # Speed at full deflection while the turbo button is held [m/s].
    v_turbo_m_s: Annotated[float, Gt(0), Le(1.0)] = 0.8
    # Turning speed at full deflection while the turbo button is held [rad/s].
    w_turbo_rad_s: Annotated[float, Gt(0), Le(6.0)] = 2.5
    # Dead zone: share of the stick's travel that counts as centred; the rest is scaled to the full range.
    dead_zone: Annotated[float, Ge(0), Lt(1)] = 0.1
    # Expo: share of the cubic term in the stick curve. 0 is linear; more is finer around the centre.
    expo: Annotated[float, Ge(0), Le(1)] = 0.3
    # Commands per second; each is valid for 0.3 s.
    rate_Hz: Annotated[float, Ge(10), Le(100)] = 20.0
