"""The robot's `[teleop]`."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le, Lt


@dataclass(frozen=True, slots=True, kw_only=True)
class TeleopOptions:
    """How sticks and keys become speeds."""

    # Speed with the stick pushed all the way [m/s] ...
    v_max_m_s: Annotated[float, Gt(0), Le(1.0)] = 0.35
    # ... and turning speed [rad/s].
    w_max_rad_s: Annotated[float, Gt(0), Le(6.0)] = 1.2
    # The same with the turbo button held [m/s] ...
    v_turbo_m_s: Annotated[float, Gt(0), Le(1.0)] = 0.8
    # ... and [rad/s].
    w_turbo_rad_s: Annotated[float, Gt(0), Le(6.0)] = 2.5
    # Share of a stick's way in which it counts as centred; the rest is stretched over the whole range.
    dead_zone: Annotated[float, Ge(0), Lt(1)] = 0.1
    # Share of the third power in the answer: 0 is linear, more is finer about the middle.
    expo: Annotated[float, Ge(0), Le(1)] = 0.3
    # Fastest change of speed while the button is held [m/s^2]; letting go stops at once.
    v_slew_m_s2: Annotated[float, Gt(0)] = 1.5
    # Fastest change of turning speed [rad/s^2].
    w_slew_rad_s2: Annotated[float, Gt(0)] = 8.0
    # Commands a second; the robot believes each for 0.3 s.
    rate_Hz: Annotated[float, Ge(10), Le(100)] = 20.0
    # A key's first press holds so long [s]: longer than the terminal waits before it repeats the key ...
    key_first_s: Annotated[float, Gt(0), Le(1)] = 0.6
    # ... and each repeat so long [s]: longer than the time between two repeats.
    key_repeat_s: Annotated[float, Gt(0), Le(1)] = 0.2
