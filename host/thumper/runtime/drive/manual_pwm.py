"""Manual driving: converts a twist to motor PWM with the motors' feed-forward alone. Pure."""

import math
from dataclasses import dataclass

from thumper.common.geometry import Twist2
from thumper.common.kinematics import DriveGeometry, limit_wheel_speeds, wheel_speeds
from thumper.config.manual_drive import ManualDriveOptions

PWM_MAX = 255
NOMINAL_V = 7.4  # the board's feed-forward parameters refer to this voltage
MIN_BATTERY_V = 5.0  # a lower reading is implausible: no compensation


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedForward:
    """Feed-forward gains of the motors: the board's parameters `ks` and `kv`."""

    ks_pwm: float
    kv_pwm_s: float  # PWM/(rad/s)


def limited_twist(twist: Twist2, options: ManualDriveOptions) -> Twist2:
    """Return the twist, scaled down to the limits of manual driving; the curvature stays the same."""
    scale = min(
        1.0,
        options.manual_v_max_m_s / max(abs(twist.v_m_s), 1e-9),
        options.manual_w_max_rad_s / max(abs(twist.w_rad_s), 1e-9),
    )
    return Twist2(v_m_s=scale * twist.v_m_s, w_rad_s=scale * twist.w_rad_s)


def manual_pwm(
    twist: Twist2,
    drive: DriveGeometry,
    options: ManualDriveOptions,
    max_wheel_rad_s: float,
    feed_forward: FeedForward,
    battery_V: float,
) -> tuple[int, int]:
    """Return left and right PWM, -255...255, for a twist within the limits.

    Without feed-forward on the board (`kv` = 0), the maximum wheel speed gets full PWM. Speeds beyond the
    limits are scaled down on both sides alike, so the curvature stays the same.
    """
    speeds = limit_wheel_speeds(wheel_speeds(limited_twist(twist, options), drive), max_wheel_rad_s)
    ks = feed_forward.ks_pwm
    kv = feed_forward.kv_pwm_s or PWM_MAX / max_wheel_rad_s
    voltage_ratio = NOMINAL_V / battery_V if battery_V > MIN_BATTERY_V else 1.0
    max_motor_rad_s = max(0.1, (PWM_MAX / voltage_ratio - ks) / kv)
    speeds = limit_wheel_speeds(speeds, max_motor_rad_s)
    return _pwm(speeds.left_rad_s, kv, ks, voltage_ratio), _pwm(speeds.right_rad_s, kv, ks, voltage_ratio)


def _pwm(speed_rad_s: float, kv: float, ks: float, voltage_ratio: float) -> int:
    if speed_rad_s == 0.0:
        return 0
    pwm = voltage_ratio * (kv * speed_rad_s + math.copysign(ks, speed_rad_s))
    return max(-PWM_MAX, min(PWM_MAX, round(pwm)))
