"""Driving by hand: a twist becomes motor PWM directly, by the motors' feed-forward and nothing else. Pure."""

import math
from dataclasses import dataclass

from thumper.common.geometry import Twist2
from thumper.common.kinematics import DriveGeometry, limit_wheel_speeds, wheel_speeds
from thumper.config.manual_drive import ManualDriveOptions

PWM_MAX = 255
NOMINAL_V = 7.4  # the voltage that the board's feed-forward parameters are given for
MIN_BATTERY_V = 5.0  # below it no reading is believed


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedForward:
    """What it takes to turn a wheel: the board's parameters `ks` and `kv`."""

    ks_pwm: float
    kv_pwm_s: float  # PWM/(rad/s)


def manual_pwm(
    twist: Twist2,
    drive: DriveGeometry,
    options: ManualDriveOptions,
    max_wheel_rad_s: float,
    feed_forward: FeedForward,
    battery_V: float,
) -> tuple[int, int]:
    """Return left and right PWM, -255...255, for the speed that is asked for within the limits.

    A board without feed-forward (`kv` = 0) gets full PWM at the fastest wheel speed. Whatever exceeds the
    motors is scaled down on both sides alike, so that a bend stays the same bend.
    """
    scale = min(
        1.0,
        options.manual_v_max_m_s / max(abs(twist.v_m_s), 1e-9),
        options.manual_w_max_rad_s / max(abs(twist.w_rad_s), 1e-9),
    )
    within = Twist2(v_m_s=scale * twist.v_m_s, w_rad_s=scale * twist.w_rad_s)
    speeds = limit_wheel_speeds(wheel_speeds(within, drive), max_wheel_rad_s)
    kv = feed_forward.kv_pwm_s or PWM_MAX / max_wheel_rad_s
    volts = NOMINAL_V / battery_V if battery_V > MIN_BATTERY_V else 1.0
    fastest_rad_s = max(0.1, (PWM_MAX / volts - feed_forward.ks_pwm) / kv)
    speeds = limit_wheel_speeds(speeds, fastest_rad_s)
    return _pwm(speeds.left_rad_s, kv, feed_forward.ks_pwm, volts), _pwm(
        speeds.right_rad_s, kv, feed_forward.ks_pwm, volts
    )


def _pwm(speed_rad_s: float, kv: float, ks: float, volts: float) -> int:
    if speed_rad_s == 0.0:
        return 0
    pwm = volts * (kv * speed_rad_s + math.copysign(ks, speed_rad_s))
    return max(-PWM_MAX, min(PWM_MAX, round(pwm)))
