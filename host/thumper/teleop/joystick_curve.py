"""From a stick and two buttons to a speed. Pure."""

import math
from dataclasses import dataclass

from thumper.common.geometry import Twist2
from thumper.common.kinematics import DriveGeometry, body_twist, limit_wheel_speeds, wheel_speeds
from thumper.config.teleop import TeleopOptions


@dataclass(frozen=True, slots=True, kw_only=True)
class JoystickState:
    """What the hand says now: both axes -1...1, forward and left positive."""

    forward: float = 0.0
    turn: float = 0.0
    enable: bool = False  # the button that must be held to drive
    turbo: bool = False


def apply_curve(value: float, dead_zone: float, expo: float) -> float:
    """An axis behind its dead zone, stretched to -1...1 again, and flatter about the middle."""
    size = min(abs(value), 1.0)
    if not size > dead_zone:  # also when it is no number
        return 0.0
    size = (size - dead_zone) / (1.0 - dead_zone)
    return math.copysign((1.0 - expo) * size + expo * size**3, value)


def joystick_twist(
    stick: JoystickState, options: TeleopOptions, drive: DriveGeometry, max_wheel_rad_s: float
) -> Twist2:
    """The speed that the stick asks for; what wheels cannot do is scaled so that a bend stays that bend."""
    if not stick.enable:
        return Twist2()
    v_max = options.v_turbo_m_s if stick.turbo else options.v_max_m_s
    w_max = options.w_turbo_rad_s if stick.turbo else options.w_max_rad_s
    asked = Twist2(
        v_m_s=v_max * apply_curve(stick.forward, options.dead_zone, options.expo),
        w_rad_s=w_max * apply_curve(stick.turn, options.dead_zone, options.expo),
    )
    return body_twist(limit_wheel_speeds(wheel_speeds(asked, drive), max_wheel_rad_s), drive)


class SpeedScaler:
    """One hand's stick, beat by beat: ramps while it is held, one zero when it lets go, then silence."""

    def __init__(self, options: TeleopOptions, drive: DriveGeometry, max_wheel_rad_s: float) -> None:
        self._options, self._drive, self._max_wheel_rad_s = options, drive, max_wheel_rad_s
        self._twist = Twist2()
        self._driving = False
        self._needs_release = True

    def step(self, stick: JoystickState | None, period_s: float) -> Twist2 | None:
        """Return what to send now, None for nothing. A stick that is lost (None) counts as let go.

        After a loss, as at the start, the button must be seen up before it counts: nothing drives off by
        itself when a pad comes back with the button held.
        """
        if stick is None:
            self._needs_release = True
        elif not stick.enable:
            self._needs_release = False
        if stick is None or not stick.enable or self._needs_release:
            was_driving, self._driving, self._twist = self._driving, False, Twist2()
            return Twist2() if was_driving else None
        wanted = joystick_twist(stick, self._options, self._drive, self._max_wheel_rad_s)
        self._driving = True
        self._twist = Twist2(
            v_m_s=_nearer(self._twist.v_m_s, wanted.v_m_s, self._options.v_slew_m_s2 * period_s),
            w_rad_s=_nearer(self._twist.w_rad_s, wanted.w_rad_s, self._options.w_slew_rad_s2 * period_s),
        )
        return self._twist


def _nearer(now: float, wanted: float, most: float) -> float:
    return now + max(-most, min(most, wanted - now))
