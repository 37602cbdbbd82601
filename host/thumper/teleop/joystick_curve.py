"""Convert a joystick and two buttons to a speed. Pure functions."""

import math
from dataclasses import dataclass

from thumper.common.geometry import Twist2
from thumper.common.kinematics import DriveGeometry, body_twist, limit_wheel_speeds, wheel_speeds
from thumper.config.teleop import TeleopOptions

# Fastest change of the command while the deadman button is held; a release stops at once.
V_SLEW_M_S2 = 1.5
W_SLEW_RAD_S2 = 8.0


@dataclass(frozen=True, slots=True, kw_only=True)
class JoystickState:
    """Joystick axes, -1...1 with forward and left positive, and buttons."""

    forward: float = 0.0
    turn: float = 0.0
    enable: bool = False  # the deadman button, which must be held to drive
    turbo: bool = False
    override: bool = False  # drive although something is in the way


def apply_curve(value: float, dead_zone: float, expo: float) -> float:
    """Return the axis after dead zone and expo curve, in -1...1; NaN becomes 0."""
    size = min(abs(value), 1.0)
    if not size > dead_zone:  # also true for NaN
        return 0.0
    size = (size - dead_zone) / (1.0 - dead_zone)
    return math.copysign((1.0 - expo) * size + expo * size**3, value)


def joystick_twist(
    stick: JoystickState, options: TeleopOptions, drive: DriveGeometry, max_wheel_rad_s: float
) -> Twist2:
    """Return the commanded speed, limited to what the wheels can do at the same curvature."""
    if not stick.enable:
        return Twist2()
    v_max = options.v_turbo_m_s if stick.turbo else options.v_max_m_s
    w_max = options.w_turbo_rad_s if stick.turbo else options.w_max_rad_s
    requested = Twist2(
        v_m_s=v_max * apply_curve(stick.forward, options.dead_zone, options.expo),
        w_rad_s=w_max * apply_curve(stick.turn, options.dead_zone, options.expo),
    )
    return body_twist(limit_wheel_speeds(wheel_speeds(requested, drive), max_wheel_rad_s), drive)


class SpeedScaler:
    """Ramps the speed of one joystick; sends one zero when the deadman button is released, then nothing."""

    def __init__(self, options: TeleopOptions, drive: DriveGeometry, max_wheel_rad_s: float) -> None:
        self._options, self._drive, self._max_wheel_rad_s = options, drive, max_wheel_rad_s
        self._twist = Twist2()
        self._driving = False
        self._needs_release = True

    def step(self, stick: JoystickState | None, period_s: float) -> Twist2 | None:
        """Return the twist to send now, or None for nothing. A lost joystick (None) counts as released.

        After a loss, and at the start, the button must be released once before it counts. So the robot does
        not drive off if a gamepad reconnects with the button held.
        """
        if stick is None:
            self._needs_release = True
        elif not stick.enable:
            self._needs_release = False
        if stick is None or not stick.enable or self._needs_release:
            was_driving, self._driving, self._twist = self._driving, False, Twist2()
            return Twist2() if was_driving else None
        target = joystick_twist(stick, self._options, self._drive, self._max_wheel_rad_s)
        self._driving = True
        self._twist = Twist2(
            v_m_s=_ramp(self._twist.v_m_s, target.v_m_s, V_SLEW_M_S2 * period_s),
            w_rad_s=_ramp(self._twist.w_rad_s, target.w_rad_s, W_SLEW_RAD_S2 * period_s),
        )
        return self._twist


def _ramp(current: float, target: float, max_step: float) -> float:
    return current + max(-max_step, min(max_step, target - current))
